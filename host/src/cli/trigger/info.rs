//! `phasewalk trigger info`: who the board is, what it can do and how it is.

use super::line::Line;
use crate::cli::{Common, print};
use crate::error::Result;
use crate::trigger::log::Board;
use crate::trigger::words;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Hello, Model, Status};
use serde_json::json;

/// Options of `trigger info`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    line: Line,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let mut connection = arguments.line.open()?;
    let hello = connection.greet()?;
    let status = connection.link.status()?.status;
    if common.json {
        let board = Board::from(&hello);
        let port = &connection.port;
        print(&json!({ "port": port, "board": board, "status": status }).to_string());
    } else {
        print(&format!("{}\n{}", who(&connection.port, &hello), how(&hello, &status)));
    }
    Ok(())
}

fn who(port: &str, hello: &Hello) -> String {
    let time = |ticks: u64| words::ticks(ticks, hello.limits.ticks_per_second);
    let limits = &hello.limits;
    let image = if hello.image_bytes > 0 {
        format!("{}, {} bytes", words::hex(hello.image), hello.image_bytes)
    } else {
        "not told".to_owned()
    };
    let mut lines = vec![
        format!("board       {} at {port}", words::model(hello.model)),
        format!("firmware    {}, image {image}", words::version(hello.version)),
        format!("sources     {}", words::hex(hello.build)),
        format!("protocol    {}", words::hex(hello.protocol)),
        format!("started by  {}", hello.reset),
        format!("clock       {} ticks/s", limits.ticks_per_second),
        format!("shortest    {} between two edges of an output", time(limits.shortest.into())),
        format!(
            "laser       {} without a break, {} in a run, at most",
            time(limits.laser_pulse.into()),
            time(limits.laser_total)
        ),
        format!("stimulus    {} in a run, at most", time(limits.stimulus_total)),
        format!("main loop   {} per pass, at most", time(limits.pass.into())),
        format!("solver      {}", solver(limits)),
        format!("frame clock {}", frame_clock(limits)),
        format!("outputs     {}", outputs(hello.model)),
    ];
    lines.extend(words::caution(hello.model).map(|caution| format!("caution     {caution}")));
    lines.join("\n")
}

fn solver(limits: &Limits) -> String {
    match limits.speckles {
        0 => "none: no phase while the run goes on".to_owned(),
        speckles => format!("up to {speckles} speckles x {} lags, on line", limits.lags),
    }
}

fn frame_clock(limits: &Limits) -> String {
    let per_second = limits.ticks_per_second;
    let time = |ticks: u32| words::ticks(ticks.into(), per_second);
    match limits.frame_longest {
        0 => "none: the camera keeps its own".to_owned(),
        longest => format!("a frame every {} to {}", time(limits.shortest), time(longest)),
    }
}

const fn outputs(model: Model) -> &'static str {
    match model {
        Model::Uno | Model::F405 => "laser, camera, stimulus",
        Model::Rehearsal => "none: it runs without outputs and makes no light",
    }
}

fn how(hello: &Hello, status: &Status) -> String {
    let per_second = hello.limits.ticks_per_second;
    let plan = if status.plan == 0 { "none".to_owned() } else { words::hex(status.plan) };
    let interlock = if status.interlock_closed { "closed" } else { "open: no run, no light" };
    let ready = if status.camera_ready { "ready" } else { "not ready" };
    let mut lines = vec![
        format!("state       {}", words::state(&status.state)),
        format!("plan        {plan}"),
        format!("interlock   {interlock}"),
        format!("camera      {ready}"),
        format!("running for {}", words::ticks(status.tick, per_second)),
    ];
    for (count, what) in [
        (status.lost, "events lost since the board started"),
        (status.garbled, "requests not understood since the board started"),
        (status.overrun, "bytes that came too fast since the board started"),
    ] {
        if count > 0 {
            lines.push(format!("note        {what}: {count}"));
        }
    }
    lines.join("\n")
}
