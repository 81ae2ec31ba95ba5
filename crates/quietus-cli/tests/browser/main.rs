//! The live view in a real browser: the page, its controls, and what a lost connection does.
//!
//! Needs `chromium` and `chromedriver`, which `cargo xtask test` installs where it may. Without them the tests say so and
//! pass, but fail where `CI` is set.

#[path = "../common/mod.rs"]
mod common;
mod program;
mod webdriver;

use std::path::PathBuf;

use base64::Engine;
use quietus_film::ToneCurve;
use serde_json::Value;

use crate::program::Program;
use crate::webdriver::{Browser, Driver};

const LAPTOP: [u32; 2] = [1440, 900];
const TABLET: [u32; 2] = [820, 1180];

/// A render that goes on for longer than any test.
const ENDLESS: &str = "--size 320x180 --target-error 1e-9 --min-samples 4 --max-samples 1000000 --threads 1";

/// A folder beside the program, for its files.
const FOLDER: &str = "there";

/// The driver, or `None` where there is none and that is no fault.
fn driver() -> Option<Driver> {
    let driver = Driver::start();
    if driver.is_none() {
        missing("chromedriver is not installed (Debian: apt-get install chromium chromium-driver)");
    }
    driver
}

/// Says loudly what is not tested; a fault where everything has to be.
fn missing(what: &str) {
    assert!(std::env::var_os("CI").is_none(), "{what}");
    eprintln!("\n*** SKIPPED, the live view is not tested: {what} ***\n");
}

/// A number that changes when the picture on the stage does.
const PICTURE: &str = "(() => {
    const { width, height } = stage, data = stage.getContext('2d').getImageData(0, 0, width, height).data;
    let sum = 0;
    for (let i = 0; i < data.length; i += 52) sum = (sum * 31 + data[i] + 3 * data[i + 1] + 7 * data[i + 2]) >>> 0;
    return sum;
})()";

/// Waits until the picture is another one than it was before `change`.
fn changes_picture(browser: &Browser<'_>, what: &str, change: impl FnOnce()) {
    let before = browser.run(&format!("return {PICTURE}"));
    change();
    browser.wait(&format!("/* {what} */ {PICTURE} !== {before}"));
}

/// Chooses from a list as a hand does, as far as the page can tell.
fn choose(browser: &Browser<'_>, list: &str, value: &str) {
    browser.run(&format!(
        "{list}.value = '{value}'; {list}.dispatchEvent(new Event('change', {{ bubbles: true }}))"
    ));
}

/// Fills a field.
fn fill(browser: &Browser<'_>, field: &str, value: &str) {
    browser.run(&format!("document.getElementById('{field}').value = '{value}'"));
}

/// Opens the page and waits for the picture.
fn look<'a>(driver: &'a Driver, program: &Program, size: [u32; 2]) -> Browser<'a> {
    let browser = Browser::open(driver, size);
    browser.go(&program.address);
    browser.wait("document.getElementById('spp').textContent > 0");
    browser
}

/// Holds the render, so that only what is done to the page changes the picture.
fn pause(browser: &Browser<'_>) {
    browser.click("#pause");
    browser
        .wait("state.textContent === 'Paused' && document.getElementById('pause').textContent === 'Resume'");
    // What was under way arrives and is painted.
    std::thread::sleep(std::time::Duration::from_millis(500));
}

#[test]
fn the_picture_arrives_and_can_be_looked_at_in_every_way() {
    let Some(driver) = driver() else { return };
    let program = Program::start(&format!("view {ENDLESS}"));
    let browser = look(&driver, &program, LAPTOP);
    changes_picture(&browser, "it converges", || ());
    // A guess at the end, and one that is told by its range.
    let told = browser.run(
        "const { timeLeft } = await import(new URL('words.js', document.baseURI));
         return [timeLeft({ remaining: 65, remaining_range: null }), timeLeft({ remaining: 65, remaining_range: [40, 90.5] })];",
    );
    assert_eq!(told.as_array().unwrap(), &["1:05", "0:40–1:30"]);
    // Until then there is no tree to be seen.
    browser.wait("curves.innerText.includes('Slowest rebuild')");
    pause(&browser);
    let still = browser.run(&format!("return {PICTURE}"));
    std::thread::sleep(std::time::Duration::from_secs(1));
    assert_eq!(browser.run(&format!("return {PICTURE}")), still, "nothing changes while it is paused");
    let units = [
        ("samples", "samples per pixel"),
        ("error", "remaining error"),
        ("depth", "distance along the view"),
        ("active", "sampling goes on"),
        ("normal", "Normal"),
        ("albedo", "Albedo"),
    ];
    for (layer, unit) in units {
        changes_picture(&browser, layer, || choose(&browser, "layer", layer));
        browser.wait(&format!("legend.innerText.includes('{unit}')"));
        if ["samples", "error", "depth"].contains(&layer) {
            browser.wait("parseFloat(document.getElementById('legend-high').textContent) > 0");
        }
    }
    changes_picture(&browser, "cividis", || {
        choose(&browser, "layer", "samples");
        choose(&browser, "map", "cividis");
    });
    changes_picture(&browser, "picture", || choose(&browser, "layer", "beauty"));
    changes_picture(&browser, "tree", || browser.click("#tree"));
    browser.click("#tree");
    changes_picture(&browser, "agx", || choose(&browser, "tone", "agx"));
    changes_picture(&browser, "linear", || choose(&browser, "tone", "linear"));
    browser.run("stage.focus()");
    for key in ["]", "+", "\u{e012}", "t", "l", "r", "0"] {
        changes_picture(&browser, key, || browser.keys(key));
    }
    assert_eq!(browser.run("return exposure.value"), "0.5");
    browser.keys("\u{e014}");
    browser.wait("pixel.textContent.includes('samples, error')");
}

#[test]
fn an_earlier_state_and_a_reference_can_be_wiped_over_the_picture() {
    let Some(driver) = driver() else { return };
    let dir = tempfile::tempdir().unwrap();
    let reference = dir.path().join("reference.exr");
    program::run(&format!("render --size 320x180 --spp 2 -o {}", reference.display()));
    let program = Program::start(&format!("view {ENDLESS} --reference {}", reference.display()));
    let browser = look(&driver, &program, LAPTOP);
    changes_picture(&browser, "kept and gone on", || browser.click("#keep"));
    pause(&browser);
    changes_picture(&browser, "wiped by a key", || {
        browser.run("stage.focus()");
        browser.keys(",,,,,,");
    });
    changes_picture(&browser, "wiped by a hand", || {
        let x = browser.run("return Math.round(stage.clientWidth * wipe.value / 100)").as_i64().unwrap();
        browser.drag([x, 400], [x + 300, 400]);
    });
    changes_picture(&browser, "reference", || choose(&browser, "compare", "reference"));
    changes_picture(&browser, "nothing", || choose(&browser, "compare", ""));
}

#[test]
fn the_render_is_steered() {
    let Some(driver) = driver() else { return };
    let program = Program::start(&format!("view {ENDLESS} -o steered.exr"));
    let browser = look(&driver, &program, LAPTOP);
    pause(&browser);
    browser.click("#pause");
    browser.wait("state.textContent.startsWith('Rendering')");
    // A new noise: no sample is lost.
    let samples = browser.run("return parseFloat(spp.textContent)").as_f64().unwrap();
    fill(&browser, "noise", "40");
    browser.click("#noise-form button");
    browser.wait("curves.innerText.includes('asked: 40')");
    browser.wait("state.textContent === 'Finished'");
    assert!(browser.run("return parseFloat(spp.textContent)").as_f64().unwrap() >= samples);
    browser.wait("notices.textContent.includes('wrote')");
    assert!(program.dir().join("steered.exr").exists());
    fill(&browser, "noise", "0.2");
    browser.click("#noise-form button");
    browser.wait(&format!(
        "state.textContent.startsWith('Rendering') && parseFloat(spp.textContent) > {samples}"
    ));
    // A crop by hand and one by numbers.
    browser.click("#crop-mode");
    browser.drag([300, 400], [700, 500]);
    browser.wait("Number(document.getElementById('crop-x0').value) > 0");
    assert!(browser.run("return Number(document.getElementById('crop-x1').value)").as_i64().unwrap() < 320);
    browser.click("#whole");
    browser.wait("document.getElementById('crop-x1').value === '320'");
    ["10", "20", "110", "70"]
        .iter()
        .zip(["x0", "y0", "x1", "y1"])
        .for_each(|(v, f)| fill(&browser, &format!("crop-{f}"), v));
    browser.click("#crop-form fieldset button");
    browser.wait("stage.getAttribute('aria-label').includes('100 by 50')");
    browser.click("#whole");
    browser.wait("stage.getAttribute('aria-label').includes('320 by 180')");
    // The camera: something shows at once, and is then drawn properly.
    browser.click("#camera-mode");
    changes_picture(&browser, "moved", || browser.drag([500, 400], [600, 430]));
    browser.wait("parseFloat(spp.textContent) > 1 && elapsed.textContent < '0:10'");
    browser.click("#home");
    browser.click("#stop");
    browser.wait("state.textContent === 'Stopped' || state.textContent === 'Finished'");
}

#[test]
fn fingers_zoom_the_picture_and_move_the_camera() {
    let Some(driver) = driver() else { return };
    let program = Program::start(&format!("view {ENDLESS}"));
    let browser = look(&driver, &program, TABLET);
    pause(&browser);
    changes_picture(&browser, "zoomed", || browser.spread([400, 300], 20, 120));
    browser.run("stage.focus()");
    changes_picture(&browser, "whole again", || browser.keys("0"));
    let still = browser.run("return document.getElementById('elapsed').textContent");
    browser.click("#camera-mode");
    changes_picture(&browser, "nearer", || browser.spread([400, 300], 20, 120));
    browser.wait(&format!("elapsed.textContent !== '{}'", still.as_str().unwrap()));
}

#[test]
fn what_cannot_be_saved_is_kept_until_it_can() {
    let Some(driver) = driver() else { return };
    let program = Program::start(&format!("view {ENDLESS} -o {FOLDER}/a.exr"));
    let folder = program.dir().join(FOLDER);
    let browser = look(&driver, &program, LAPTOP);
    std::fs::remove_dir(&folder).unwrap();
    browser.click("#stop");
    browser.wait("notices.textContent.includes('not written: ')");
    browser.wait("document.getElementById('stop').textContent === 'Save again'");
    let samples = browser.run("return spp.textContent");
    std::fs::create_dir(&folder).unwrap();
    browser.click("#stop");
    browser.wait("notices.textContent.includes('wrote ')");
    assert!(folder.join("a.exr").exists());
    assert_eq!(browser.run("return spp.textContent"), samples, "it is the picture that could not be written");
}

/// The page's AgX and that of `quietus convert` are the same curve.
#[test]
fn tones_are_those_of_converted_pictures() {
    let Some(driver) = driver() else { return };
    let program = Program::start(&format!("view {ENDLESS}"));
    let browser = look(&driver, &program, LAPTOP);
    // Half floats with their bits: 0, 2^-24, 2^-14, 0.1, 0.18, 1/2, 1, 3, 20, 65504.
    let halves = [0, 1, 0x0400, 0x2e66, 0x31c3, 0x3800, 0x3c00, 0x4200, 0x4d00, 0x7bff];
    let values =
        [0.0, 2_f32.powi(-24), 2_f32.powi(-14), 0.099_975_586, 0.180_053_71, 0.5, 1.0, 3.0, 20.0, 65504.0];
    for (name, curve) in [("agx", ToneCurve::AgX), ("srgb", ToneCurve::Srgb), ("linear", ToneCurve::Linear)] {
        let codes = browser.run(&format!(
            "const tone = (await import(new URL('tone.js', document.baseURI))).toneCurve('{name}', 0);
             const halves = {halves:?}, codes = [];
             for (const r of halves) for (const g of halves) for (const b of halves) codes.push(tone([r, g, b], 0));
             return codes;"
        ));
        let colors = values.iter().flat_map(|r| values.iter().flat_map(|g| values.map(|b| [*r, *g, b])));
        for (color, code) in colors.zip(codes.as_array().unwrap()) {
            let ours = curve.encode(color).map(i64::from);
            let code = code.as_i64().unwrap();
            let theirs = [code & 255, code >> 8 & 255, code >> 16 & 255];
            // The page's table has eight binary digits: a stop's 360th, which is a tenth of a code, and may round away.
            assert!(
                ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() <= 1),
                "{name} {color:?}: {ours:?} {theirs:?}"
            );
        }
    }
}

#[test]
fn two_pages_see_the_same_and_one_that_goes_leaves_the_other_alone() {
    let Some(driver) = driver() else { return };
    let program = Program::start(&format!("view {ENDLESS}"));
    let first = look(&driver, &program, LAPTOP);
    let second = look(&driver, &program, TABLET);
    pause(&first);
    second.wait("state.textContent === 'Paused'");
    drop(first);
    second.click("#pause");
    second.wait("state.textContent.startsWith('Rendering')");
    changes_picture(&second, "it goes on", || ());
}

#[test]
fn a_page_finds_its_render_again() {
    let Some(driver) = driver() else { return };
    let program = Program::start(&format!("view {ENDLESS}"));
    let browser = look(&driver, &program, LAPTOP);
    let port = program.port();
    drop(program);
    browser.wait("state.textContent.includes('trying again')");
    assert_eq!(browser.run("return document.getElementById('pause').disabled"), true);
    let _program = Program::start(&format!("view {ENDLESS} --port {port}"));
    browser.wait("state.textContent.startsWith('Rendering') && spp.textContent > 0");
    changes_picture(&browser, "it converges again", || ());
}

/// By axe-core's rules for WCAG 2.2 AA and good practice, in every state that shows something else.
#[test]
fn the_page_is_accessible() {
    let Some(driver) = driver() else { return };
    let Some(axe) = std::env::var_os("QUIETUS_AXE").map(PathBuf::from) else {
        return missing("QUIETUS_AXE does not name axe.min.js of the npm package axe-core");
    };
    let axe = std::fs::read_to_string(axe).expect("axe-core can be read");
    let program = Program::start(&format!("view {ENDLESS}"));
    for size in [LAPTOP, TABLET] {
        let browser = look(&driver, &program, size);
        if size == LAPTOP {
            pause(&browser);
        }
        browser.run(&axe);
        let check = |what: &str| {
            let faults = browser.run(
                "const result = await axe.run();
                 return result.violations.map((v) => [v.id, v.help, v.nodes.map((n) => n.html)]);",
            );
            assert_eq!(faults, Value::Array(Vec::new()), "{what} at {size:?}");
        };
        check("the picture");
        choose(&browser, "layer", "error");
        browser.click("#tree");
        browser.click("#keep");
        browser.click("#camera-mode");
        browser.click("summary");
        check("with everything open");
        browser.run("document.querySelector('summary').click(); document.activeElement.blur()");
        let name = format!("live-view-{}x{}.png", size[0], size[1]);
        let png = base64::engine::general_purpose::STANDARD.decode(browser.screenshot()).expect("base64");
        let shots = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
        std::fs::write(shots.join(name), png).expect("the screenshot is written");
    }
}
