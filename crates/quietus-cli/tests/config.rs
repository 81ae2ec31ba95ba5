//! `quietus.toml` and completions from outside.

mod common;

use std::path::Path;
use std::process::Output;

use common::{command, refusal, stderr, stdout, succeeded};
use quietus_film::read_exr;

/// Runs the program in `dir`, which also is where the user's settings are.
fn quietus(dir: &Path, arguments: &str) -> Output {
    command(dir, arguments).env("XDG_CONFIG_HOME", dir.join("home")).output().expect("the program starts")
}

/// Runs it, wants that exit code, returns the message.
fn refused(dir: &Path, arguments: &str, code: i32) -> String {
    refusal(arguments, &quietus(dir, arguments), code)
}

/// What `a.exr` says of a setting after `quietus ARGUMENTS`.
fn setting(dir: &Path, arguments: &str, name: &str) -> String {
    succeeded(arguments, quietus(dir, arguments));
    let (_, metadata) = read_exr(&dir.join("a.exr")).unwrap();
    metadata.into_iter().find(|(n, _)| n == name).map_or_else(String::new, |(_, value)| value)
}

#[test]
fn the_file_decides_what_the_command_line_leaves_open() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    let text = "[render]\nsize = '24x16'\nseed = 7\nspp = 2\noutput = ['a.exr']\nfilter = 'box'\n[compare]\njson = true\n";
    std::fs::write(at.join("quietus.toml"), text).unwrap();
    assert_eq!(setting(at, "render", "seed"), "7");
    assert_eq!(setting(at, "", "seed"), "7", "`quietus` alone, too");
    assert_eq!(setting(at, "render --seed 8", "seed"), "8");
    assert_eq!(setting(at, "render --seed 8", "filter"), "box");
    // What excludes a setting of the file overrules it.
    assert_eq!(setting(at, "render --width 12 --spp 4", "width"), "12");
    assert_eq!(setting(at, "render --noise 30%", "sampling"), "quietus");
    assert_eq!(setting(at, "render --no-config -o a.exr --size 8x8 --spp 1", "seed"), "0");
    let said = stderr(&quietus(at, "render -v"));
    assert!(said.contains("settings: from quietus.toml: size, seed, spp, output, filter"), "{said}");
    assert!(stdout(&quietus(at, "compare a.exr a.exr")).starts_with('['));
    let said = stdout(&quietus(at, "config"));
    assert!(said.starts_with("quietus.toml\n   2  quietus render --size=24x16\n"), "{said}");
}

#[test]
fn files_are_looked_for_here_and_with_the_users_settings() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    assert!(stdout(&quietus(at, "config")).starts_with("no settings file; looked for quietus.toml"));
    let with_seed = |seed: u32| format!("[render]\nsize = '8x8'\nspp = 1\noutput = 'a.exr'\nseed = {seed}");
    // Other systems keep settings elsewhere.
    if cfg!(target_os = "linux") {
        std::fs::create_dir_all(at.join("home/quietus")).unwrap();
        std::fs::write(at.join("home/quietus/quietus.toml"), with_seed(1)).unwrap();
        assert_eq!(setting(at, "render", "seed"), "1");
    }
    std::fs::write(at.join("quietus.toml"), with_seed(2)).unwrap();
    assert_eq!(setting(at, "render", "seed"), "2");
    std::fs::write(at.join("other.toml"), with_seed(3)).unwrap();
    assert_eq!(setting(at, "render --config other.toml", "seed"), "3");
    assert!(refused(at, "render --config none.toml", 3).contains("none.toml: no such file"));
}

#[test]
fn mistakes_in_the_file_are_told_with_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    let cases = [
        ("[render]\n\nsed = 1", "quietus.toml:3: `quietus render` has no setting `sed`; is `seed` meant?"),
        (
            "[render]\nseed = 1\nsize = 'big'",
            "quietus.toml:3: `size`: invalid value 'big' for '--size <WxH>': expected",
        ),
        ("[render]\nspp = -1", "quietus.toml:2: `spp`: invalid value '-1'"),
        ("[render]\nspp = 4\nnoise = '1%'", "quietus.toml: the argument '--spp <N>' cannot be used with"),
        ("[render]\nspp = 4\nmin-samples = 8", "from quietus.toml: spp, min-samples"),
        ("render", "quietus.toml:1: not TOML"),
    ];
    for (text, expected) in cases {
        std::fs::write(at.join("quietus.toml"), text).unwrap();
        let message = refused(at, "render -o a.png", 2);
        assert!(message.contains(expected), "{text:?}: {message}");
        assert!(!at.join("a.png").exists());
    }
}

#[test]
fn completions_know_commands_and_flags() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = stdout(&quietus(Path::new("."), &format!("completions {shell} --no-config")));
        for word in ["inspect", "save-every", "tone"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(quietus(Path::new("."), "completions tcsh").status.code(), Some(2));
}

#[test]
fn every_command_has_examples() {
    for command in ["render", "info", "eval", "compare", "inspect", "convert", "completions"] {
        let help = stdout(&quietus(Path::new("."), &format!("{command} --help")));
        assert!(help.contains(&format!("Examples:\n  quietus {command}")), "{command}: {help}");
    }
}
