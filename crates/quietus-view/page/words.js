// Numbers and times as people read them.

/** With three digits that count. */
export function number(value) {
  if (!Number.isFinite(value)) return String(value);
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) return value.toExponential(2);
  return value.toFixed(Math.max(0, 2 - Math.floor(Math.log10(size))));
}

/** Such as 2.31 M. */
export function large(value) {
  for (const [unit, name] of [[1e9, " G"], [1e6, " M"], [1e3, " k"]]) {
    if (value >= unit) return number(value / unit) + name;
  }
  return number(value);
}

/** Hours, minutes and seconds as 1:02:03 or 2:03. */
export function time(seconds) {
  if (seconds === null || seconds === undefined) return "?";
  const s = Math.floor(seconds), two = (n) => String(n).padStart(2, "0");
  const hours = Math.floor(s / 3600), minutes = Math.floor(s / 60) % 60;
  return hours ? `${hours}:${two(minutes)}:${two(s % 60)}` : `${minutes}:${two(s % 60)}`;
}

/** A guess, or its range where that is sent: it is too wide then. */
export function timeLeft({ remaining, remaining_range: range }) {
  return range ? range.map(time).join("–") : time(remaining);
}

export const percent = (share) => `${(100 * share).toFixed(1)} %`;
