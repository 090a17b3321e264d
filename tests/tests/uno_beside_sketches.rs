//! The board's edges beside those of Arduino sketches that do the same as laboratories do today
//! (tests/sketches), on the same emulated board.

use phasewalk_tests::board::{Pin, Uno};
use phasewalk_tests::random::Random;
use phasewalk_tests::session::{MS, SECOND, Session, image, paper};
use std::path::{Path, PathBuf};
use std::process::Command;

const VOLUMES: usize = 70;
const INTERVAL: i64 = 225 * MS as i64;

/// What is wrong with a sequence, in cycles.
#[derive(Debug, PartialEq, Eq)]
struct Jitter {
    /// Of the laser's periods, peak to peak.
    period: i64,
    /// Of camera less laser, peak to peak.
    camera: i64,
    /// Of the last volume against the first.
    end: i64,
}

fn jitter(board: &Uno) -> Jitter {
    let rises = |pin: Pin| -> Vec<i64> {
        board.edges_of(pin).filter(|edge| edge.level).map(|edge| edge.cycle as i64).collect()
    };
    let (laser, camera) = (rises(Pin::D9), rises(Pin::D10));
    assert_eq!((laser.len(), camera.len()), (VOLUMES, VOLUMES));
    let spread = |values: Vec<i64>| {
        values.iter().max().expect("values") - values.iter().min().expect("values")
    };
    let periods = laser.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let lags = camera.iter().zip(&laser).map(|(camera, laser)| camera - laser).collect();
    let end = laser[VOLUMES - 1] - laser[0] - (VOLUMES as i64 - 1) * INTERVAL;
    Jitter { period: spread(periods), camera: spread(lags), end }
}

fn show(name: &str, line: &str, jitter: &Jitter) {
    let Jitter { period, camera, end } = jitter;
    let end = *end as f64 / 16.0;
    println!("{name} | {line} | {period} | {camera} | {end:.1} µs");
}

/// A sketch's run with the line idle or flooded.
fn sketch(folder: &Path, name: &str, flooded: bool) -> Jitter {
    let mut board = Uno::load(&folder.join(format!("{name}.elf"))).expect("the sketch was built");
    let mut random = Random::new(3);
    let length = (VOLUMES as u64 + 2) * 225 * MS + SECOND;
    board.run_for(100 * MS);
    if flooded {
        let until = board.cycle() + length;
        board.flood(until, || random.bits() as u8);
    } else {
        board.run_for(length);
    }
    jitter(&board)
}

fn ours(flooded: bool) -> Jitter {
    let plan = paper();
    let mut session = Session::new(Uno::load(&image()).expect("the image can be loaded"));
    session.hello();
    session.arm(&plan);
    session.begin();
    if flooded {
        session.run_flooded(plan.length() + 30 * MS, &mut Random::new(3));
    } else {
        session.run_for(plan.length() + 30 * MS);
    }
    jitter(&session.board)
}

fn build_sketches() -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = image().with_file_name("sketches");
    let build = Command::new("sh").arg(tests.join("sketches/build.sh")).arg(&folder).status();
    assert!(build.expect("sh starts").success(), "the sketches build (arduino-core-avr)");
    folder
}

#[test]
fn sketches_jitter_and_drift_and_the_board_does_not() {
    let folder = build_sketches();
    println!("program | line | laser period p-p, cycles | camera-laser spread, cycles | end error");
    for flooded in [false, true] {
        let line = if flooded { "flooded" } else { "idle" };
        for name in ["digital_write", "micros"] {
            let jitter = sketch(&folder, name, flooded);
            show(name, line, &jitter);
            assert!(jitter.period > 50, "a sketch without jitter: is it measured?");
        }
        let jitter = ours(flooded);
        show("Phasewalk", line, &jitter);
        assert_eq!(jitter, Jitter { period: 0, camera: 0, end: 0 });
    }
}
