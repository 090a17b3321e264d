//! `cargo xtask instructions`: how many instructions the release program executes, against recorded numbers.
//!
//! Times differ from machine to machine and with what else runs there; instructions of one thread repeat to some 1e-4.
//! They say nothing of caches, and Valgrind knows no AVX-512, so AVX2 and plain Rust are counted:
//! the generic code above the registers is the same.

mod callgrind;
mod table;

use crate::command::{cargo, command, run};
use crate::packages::VALGRIND;
use crate::{Result, folders};
use std::path::Path;
use table::Table;

/// What is counted: a name for people, the path of vector instructions, and the program's command line.
struct Case {
    name: &'static str,
    simd: &'static str,
    arguments: &'static str,
}

/// Size of the scene: rows of 7 * 16 pixels, so that the halo of sigma = 3 px is rotated in registers, as in the
/// paper's rows of 640.
const WIDTH: usize = 112;
const HEIGHT: usize = 24;
const FRAMES: usize = 24;

const CASES: [Case; 8] = [
    Case {
        name: "images, paper, avx2",
        simd: "avx2",
        arguments: "phase F.npy --gaussian 3 --method paper -o paper-avx2.npy",
    },
    Case {
        name: "images, linked, avx2",
        simd: "avx2",
        arguments: "phase F.npy --gaussian 3 -o linked-avx2.npy",
    },
    Case {
        name: "images, paper, portable",
        simd: "portable",
        arguments: "phase F.npy --gaussian 3 --method paper -o paper.npy",
    },
    Case {
        name: "images, linked, portable",
        simd: "portable",
        arguments: "phase F.npy --gaussian 3 -o linked.npy",
    },
    Case {
        name: "curve, paper",
        simd: "portable",
        arguments: "phase F.npy --mask F.mask.npy --method paper -o paper.csv",
    },
    Case {
        name: "curve, linked",
        simd: "portable",
        arguments: "phase F.npy --mask F.mask.npy -o linked.csv",
    },
    Case {
        name: "watched images",
        simd: "portable",
        arguments: "watch - --gaussian 3 -o newest.npy",
    },
    Case {
        name: "watched curve, linked",
        simd: "portable",
        arguments: "watch - --mask F.mask.npy -o watched.csv",
    },
];

/// Count, and compare with the recorded numbers.
pub(crate) fn check() -> Result {
    if !is_counted_here() {
        println!("   not counted: the recorded numbers are those of x86-64 with AVX2");
        return Ok(());
    }
    let recorded = Table::read(&table_file())?;
    let counted = count()?;
    let mut failures = Vec::new();
    for (name, count) in &counted.counts {
        match recorded.judge(name, *count, &counted.rustc) {
            Ok(line) => println!("   {line}"),
            Err(line) => failures.push(line),
        }
    }
    failures.extend(recorded.not_among(&counted).map(|name| {
        format!("{name}: recorded, but not counted any more: `cargo xtask instructions --record`")
    }));
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n")) }
}

/// Count, and record the numbers for the next time.
pub(crate) fn record() -> Result {
    if !is_counted_here() {
        return Err("only x86-64 with AVX2 can record instructions".to_owned());
    }
    let counted = count()?;
    print!("{}", counted.text());
    counted.write(&table_file())
}

fn table_file() -> std::path::PathBuf {
    folders::workspace().join("tests").join("instructions.toml")
}

/// Has this machine the instructions that are counted?
fn is_counted_here() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    return false;
}

/// Count all cases, side by side: how busy the machine is does not matter.
fn count() -> Result<Table> {
    VALGRIND.meet()?;
    run(&mut cargo("build --release"))?;
    let program = folders::phasewalk()?;
    let folder = folders::scratch("instructions")?;
    simulate(&program, &folder)?;
    let one = |case: &Case| callgrind::count(&program, case, &folder);
    let counts = std::thread::scope(|scope| {
        let under_way: Vec<_> =
            CASES.iter().map(|case| (case.name, scope.spawn(|| one(case)))).collect();
        let each = under_way.into_iter().map(|(name, thread)| {
            let count = thread.join().map_err(|_| format!("{name}: the counting stopped"))??;
            Ok((name.to_owned(), count))
        });
        each.collect::<Result<Vec<_>>>()
    })?;
    Ok(Table { rustc: rustc()?, counts })
}

/// The scene as a file, F.npy, and as the program watches it without waiting, F.pipe.
fn simulate(program: &Path, folder: &Path) -> Result {
    let scene = format!(
        "simulate speckle --width {WIDTH} --height {HEIGHT} --frames {FRAMES} --scatterers 10 \
         --seed 7 --sigma 1/32 -o F.npy"
    );
    run(command(program).args(scene.split_whitespace()).current_dir(folder))?;
    let series = std::fs::read(folder.join("F.npy")).map_err(|e| format!("no F.npy: {e}"))?;
    // Behind the header of a .npy file come just the frames: 8 bytes a number.
    let begin = series.len().checked_sub(FRAMES * HEIGHT * WIDTH * 8);
    let frames = begin.and_then(|begin| series.get(begin..)).ok_or("F.npy is too short")?;
    let head = format!(
        "{{\"format\":\"phasewalk-frames/1\",\"height\":{HEIGHT},\"width\":{WIDTH},\
         \"dtype\":\"complex64\"}}\n"
    );
    let pipe = [head.as_bytes(), frames].concat();
    std::fs::write(folder.join("F.pipe"), pipe).map_err(|e| format!("cannot write F.pipe: {e}"))
}

/// Version of the compiler, whose changes change the counts.
fn rustc() -> Result<String> {
    let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = command(compiler).arg("--version").output();
    let output = output.map_err(|e| format!("cannot ask rustc for its version: {e}"))?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
