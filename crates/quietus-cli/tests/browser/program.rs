//! The program, running.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};

use crate::common::{command, quietus, succeeded};

/// The same for all runs, so that one can be found again by the page of another.
const TOKEN: &str = "0123456789abcdef0123456789abcdef";

/// A running `quietus`; killed when dropped.
pub(crate) struct Program {
    process: Child,
    dir: tempfile::TempDir,
    /// Of its page.
    pub(crate) address: String,
}

/// Runs it to its end, which must be a good one.
pub(crate) fn run(arguments: &str) {
    succeeded(arguments, quietus(Path::new("."), arguments));
}

impl Program {
    /// Starts it and waits until it says where its page is.
    pub(crate) fn start(arguments: &str) -> Self {
        let dir = tempfile::tempdir().expect("a temporary directory");
        std::fs::create_dir(dir.path().join(crate::FOLDER)).expect("a folder for files");
        let mut command = command(dir.path(), arguments);
        command.env("QUIETUS_VIEW_TOKEN", TOKEN).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().expect("the program starts");
        let lines = BufReader::new(process.stdout.take().expect("it is piped")).lines();
        let address = lines
            .map_while(Result::ok)
            .find_map(|line| Some(line.split_once("browser: ")?.1.trim().to_owned()));
        Self { process, dir, address: address.expect("it says its address") }
    }

    /// Where it writes.
    pub(crate) fn dir(&self) -> &Path {
        self.dir.path()
    }

    /// Of its server.
    pub(crate) fn port(&self) -> u16 {
        let rest = self.address.trim_start_matches("http://127.0.0.1:");
        rest.split('/').next().and_then(|port| port.parse().ok()).expect("an address has a port")
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
