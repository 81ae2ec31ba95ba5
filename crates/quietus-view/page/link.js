// The connection to the render: messages out of the websocket, requests into it, and another try when it breaks.

// Kinds of binary messages, as message.rs numbers them.
const TILES = 1, COARSE = 2, TREE = 3;
export const LAYERS = ["beauty", "samples", "error", "active", "albedo", "normal", "depth"];

const FIRST_WAIT = 300, LONGEST_WAIT = 4000;

/** Calls `on.NAME(message)` for every message: session, status, history, pixel, notice, tiles, coarse, tree, open, lost. */
export function connect(on) {
  const address = new URL("ws", location.href);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  let socket = null, wait = FIRST_WAIT;

  function open() {
    socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { wait = FIRST_WAIT; on.open(); };
    socket.onmessage = ({ data }) => (typeof data === "string" ? told(JSON.parse(data)) : binary(data));
    socket.onclose = () => {
      on.lost();
      setTimeout(open, wait);
      wait = Math.min(2 * wait, LONGEST_WAIT);
    };
  }

  const told = (message) => on[message.is]?.(message);

  function binary(buffer) {
    const [kind, layer] = new Uint8Array(buffer, 0, 2);
    const session = new Uint32Array(buffer, 4, 1)[0];
    if (kind === TILES) {
      const count = new Uint32Array(buffer, 8, 1)[0];
      const indices = new Uint32Array(buffer, 12, count);
      on.tiles({ session, layer: LAYERS[layer], indices, buffer, offset: 12 + 4 * count });
    } else if (kind === COARSE) {
      const window = new Int32Array(buffer, 8, 4), [width, height] = new Uint32Array(buffer, 24, 2);
      on.coarse({ session, window, width, height, halves: new Uint16Array(buffer, 32) });
    } else if (kind === TREE) {
      const [complete, active] = new Uint32Array(buffer, 8, 2);
      on.tree({ session, complete, active, sides: new Float32Array(buffer, 16) });
    }
  }

  function ask(request) {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request));
  }

  open();
  return { ask };
}
