//! What the live view costs a render: time per sample with and without a browser's worth of traffic, memory per client.

use std::{
    io::{BufRead, BufReader},
    net::TcpStream,
    path::Path,
    process::{Child, Command, Stdio},
    time::Duration,
};

use anyhow::{Context, Result};
use serde_json::Value;
use tungstenite::{Message, WebSocket, client::IntoClientRequest};

use crate::run::{Quietus, median, number};

/// Runs of each kind, in turns, so that what else the machine does falls on both.
const RUNS: usize = 3;

/// Clients whose memory is measured together.
const CLIENTS: usize = 8;

/// Few samples: tiles change most often, for what they cost to draw, in the first passes.
const RENDER: [&str; 5] = ["render", "--size", "1920x1080", "--spp", "4"];

pub(crate) fn view(quietus: &Quietus) -> Result<()> {
    cost(quietus)?;
    memory(quietus)
}

/// CPU and wall time per sample, alone and with one client that takes everything at once.
fn cost(quietus: &Quietus) -> Result<()> {
    println!(
        "| run | CPU, alone | CPU, with a client | ratio | wall, alone | wall, with a client | ratio | share of the view's threads |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let (mut cpu, mut wall) = (Vec::new(), Vec::new());
    for run in 1..=RUNS {
        let alone = time(quietus, false)?;
        let watched = time(quietus, true)?;
        let ratios = [0, 1].map(|i| watched[i] / alone[i]);
        let nanoseconds = |time: f64| format!("{:.0} ns", 1e9 * time);
        println!(
            "| {run} | {} | {} | {:.4} | {} | {} | {:.4} | {:.2} % |",
            nanoseconds(alone[0]),
            nanoseconds(watched[0]),
            ratios[0],
            nanoseconds(alone[1]),
            nanoseconds(watched[1]),
            ratios[1],
            100.0 * watched[2]
        );
        cpu.push(ratios[0]);
        wall.push(ratios[1]);
    }
    println!("| median | | | {:.4} | | | {:.4} | |", median(cpu), median(wall));
    Ok(())
}

/// CPU and wall time per sample in seconds, and the share of all CPU time that threads took which do not render.
fn time(quietus: &Quietus, with_client: bool) -> Result<[f64; 3]> {
    let stats = quietus.scratch.path().join("view.json");
    let mut command = Command::new(quietus.program());
    command.args(RENDER).arg("-o").arg(quietus.picture()).arg("--stats").arg(&stats);
    let mut share = 0.0;
    if with_client {
        let (mut render, address) = start(command.arg("--view"))?;
        let mut socket = connect(&address)?;
        while let Ok(is_status) = take(&mut socket) {
            if is_status {
                share = other_share(&render).unwrap_or(share);
            }
        }
        render.wait()?;
    } else {
        command.stdout(Stdio::null()).stderr(Stdio::null()).status()?;
    }
    let stats: Value = serde_json::from_str(&std::fs::read_to_string(&stats)?)?;
    let samples = number(&stats, "samples")?;
    Ok([number(&stats, "cpu_seconds")? / samples, number(&stats, "wall_seconds")? / samples, share])
}

/// Share of the CPU time so far that threads took which are not called `render-N`: the server's and the watcher's. The
/// process's own time has that of threads, too, that have ended.
fn other_share(render: &Child) -> Result<f64> {
    let folder = Path::new("/proc").join(render.id().to_string());
    let (_, all) = name_and_ticks(&folder.join("stat"))?;
    let mut others = 0.0;
    for task in std::fs::read_dir(folder.join("task"))? {
        let (name, ticks) = name_and_ticks(&task?.path().join("stat"))?;
        others += if name.contains("(render-") { 0.0 } else { ticks };
    }
    Ok(others / all.max(1.0))
}

/// The name of a process or thread, and its user and system time.
fn name_and_ticks(stat: &Path) -> Result<(String, f64)> {
    let stat = std::fs::read_to_string(stat)?;
    // The name in parentheses may hold anything; the times are the 12th and 13th words after it.
    let (name, words) = stat.rsplit_once(')').context("no name of a thread")?;
    let ticks = words.split_whitespace().skip(11).take(2).filter_map(|word| word.parse::<f64>().ok());
    Ok((name.to_owned(), ticks.sum()))
}

/// Resident memory before and after clients have come and seen the whole picture.
fn memory(quietus: &Quietus) -> Result<()> {
    let mut command = Command::new(quietus.program());
    command.args(["view", "--size", "1920x1080", "--spp", "2", "-o"]).arg(quietus.picture());
    let (mut render, address) = start(&mut command)?;
    let mut sockets = vec![connect(&address)?];
    settle(&mut sockets);
    let before = resident(&render)?;
    for _ in 0..CLIENTS {
        sockets.push(connect(&address)?);
    }
    settle(&mut sockets);
    let each = (resident(&render)? - before) / CLIENTS as f64;
    println!("\nMemory: {:.0} MiB with one client, {:.2} MiB for each further one.", before, each);
    render.kill()?;
    render.wait()?;
    Ok(())
}

/// Starts it and waits for the address of its page.
fn start(command: &mut Command) -> Result<(Child, String)> {
    let mut render = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?;
    let lines = BufReader::new(render.stdout.take().context("stdout is piped")?).lines();
    let address =
        lines.map_while(Result::ok).find_map(|line| Some(line.split_once("browser: ")?.1.to_owned()));
    Ok((render, address.context("the program says no address")?))
}

type Socket = WebSocket<TcpStream>;

fn connect(address: &str) -> Result<Socket> {
    let address = address.trim_start_matches("http://");
    let (host, _) = address.split_once('/').context("an address has a path")?;
    let request = format!("ws://{address}ws").into_client_request()?;
    let stream = TcpStream::connect(host)?;
    stream.set_read_timeout(Some(Duration::from_secs(5)))?;
    let (socket, _) = tungstenite::client(request, stream).map_err(|error| anyhow::anyhow!("{error}"))?;
    Ok(socket)
}

/// Takes one message, as a page does, and tells whether it was words.
fn take(socket: &mut Socket) -> Result<bool> {
    let message = socket.read()?;
    if matches!(&message, Message::Binary(bytes) if bytes.first() == Some(&1)) {
        socket.send(Message::text(r#"{"do":"ack"}"#))?;
    }
    Ok(message.is_text())
}

/// Lets every client take messages until none comes for a while: then the picture is finished and seen.
fn settle(sockets: &mut [Socket]) {
    for socket in sockets {
        while take(socket).is_ok() {}
    }
}

/// In MiB.
fn resident(render: &Child) -> Result<f64> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", render.id()))?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).context("no VmRSS")?;
    let kib = line.split_whitespace().nth(1).and_then(|kib| kib.parse::<f64>().ok()).context("no number")?;
    Ok(kib / 1024.0)
}
