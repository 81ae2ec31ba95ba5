//! `quietus eval` from outside.

mod common;

use std::path::Path;
use std::process::Output;

use common::{command, stderr, stdout};

fn eval(directory: &Path, arguments: &[&str]) -> Output {
    command(directory, "eval --cache cache --size 16x12").args(arguments).output().unwrap()
}

#[test]
fn one_command_records_compares_and_reports() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = "--streams 4 --samples 32 --reference-spp 64 --budgets 36 --methods talk,quietus \
                     --json a.json --html a.html";
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let first = eval(directory.path(), &arguments);
    let (table, asides) = (stdout(&first), stderr(&first));
    assert!(first.status.success(), "{asides}");
    assert!(table.contains("embedded: 16x12, 4 streams of 32 samples; reference of 64 spp"), "{table}");
    assert!(asides.contains("making the bank"), "{asides}");
    let json = std::fs::read(directory.path().join("a.json")).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(json[0]["bank"]["streams"], 4);
    assert!(json[0]["points"].as_array().unwrap().iter().any(|p| p["method"] == "uniform"));
    let html = std::fs::read_to_string(directory.path().join("a.html")).unwrap();
    assert!(html.contains("<svg") && html.contains("data:image/png;base64,") && !html.contains("http-equiv"));
    // What was recorded is used again, and says the same.
    let second = eval(directory.path(), &arguments);
    assert_eq!(stdout(&second), table);
    assert!(!stderr(&second).contains("making"));
}

#[test]
fn equivalence_is_shown_or_not() {
    let directory = tempfile::tempdir().unwrap();
    let arguments =
        "--equivalence unbiased --runs 4 --samples 24 --budgets 40 --reference-spp 64 --json a.json";
    let output = eval(directory.path(), &arguments.split_whitespace().collect::<Vec<_>>());
    let text = stdout(&output);
    assert!(output.status.success(), "{}", stderr(&output));
    // Four runs can never do: the interval of a mean of four is far wider than the margin.
    assert!(text.contains("4 runs of") && text.contains("equivalence not shown"), "{text}");
    let json = std::fs::read(directory.path().join("a.json")).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!((&json[0]["method"], &json[0]["runs"]), (&"unbiased".into(), &4.into()));
}

#[test]
fn what_makes_no_sense_is_refused_before_anything_is_recorded() {
    let directory = tempfile::tempdir().unwrap();
    for (arguments, code, message) in [
        (&["--methods", "best"][..], 2, "expected one of uniform, tile"),
        (&["--budgets", "-3"], 2, "expected a number above 0"),
        (&["--filter", "sinc"], 2, "expected one of box, triangle, gaussian, blackman-harris"),
        (&["--streams", "3"], 2, "expected an even number"),
        (&["missing.glb"], 3, "missing.glb"),
        (&["--json", "no/such/a.json"], 4, "no/such/a.json"),
    ] {
        let output = eval(directory.path(), arguments);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
        assert!(!directory.path().join("cache").exists(), "{arguments:?}");
    }
}

#[test]
fn a_black_picture_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let scene = "Camera \"perspective\"\nWorldBegin\nShape \"sphere\"\n";
    std::fs::write(directory.path().join("dark.pbrt"), scene).unwrap();
    let few = ["dark.pbrt", "--streams", "2", "--samples", "8", "--reference-spp", "32"];
    for more in [&[][..], &["--equivalence", "unbiased", "--runs", "2"]] {
        let output = eval(directory.path(), &[&few, more].concat());
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        let expected = "error: dark: the picture is black: there is nothing to measure";
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
}
