//! The `phasewalk` program, driven as a user does.

use serde_json::Value;
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use tempfile::TempDir;

/// The program's file, built in the profile of the running test.
///
/// Cargo names the programs of a package to its own tests only, so they are looked for where it
/// puts them: the test runs as `target/PROFILE/deps/NAME`, the program is `target/PROFILE/phasewalk`.
///
/// # Panics
/// If it cannot be built.
#[must_use]
pub fn phasewalk() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let test = env::current_exe().expect("a test has a file");
        let folder = test.parent().and_then(Path::parent).expect("it lies in target/PROFILE/deps");
        let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut build = Command::new(cargo);
        build.args(["build", "--quiet", "--bin", "phasewalk", "--target-dir"]);
        build.arg(folder.parent().expect("PROFILE lies in target")).current_dir(workspace());
        if folder.ends_with("release") {
            build.args(["--release", "--package", "phasewalk"]);
        } else {
            // The same packages and features as of the tests: nothing is compiled again.
            build.arg("--workspace");
            if cfg!(feature = "emulated-boards") {
                build.args(["--features", "phasewalk-tests/emulated-boards"]);
            }
        }
        let output = build.output().expect("cargo can be run");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        folder.join("phasewalk")
    })
}

/// The folder of the whole project.
///
/// # Panics
/// If the tests are not where they were compiled.
#[must_use]
pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests lie in the workspace")
}

/// A folder of its own, in which the program runs.
pub struct Bench {
    folder: TempDir,
}

impl Default for Bench {
    fn default() -> Self {
        Self::new()
    }
}

impl Bench {
    /// An empty folder.
    ///
    /// # Panics
    /// If the machine gives none.
    #[must_use]
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    /// A file in it.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Names of all that is in it, hidden or not, in order.
    ///
    /// # Panics
    /// If it cannot be read.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        names_in(self.folder.path())
    }

    /// The program, to be run in the folder, one argument per word of `line`.
    #[must_use]
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(phasewalk());
        command.args(line.split_whitespace()).current_dir(self.folder.path());
        command.env_remove("PHASEWALK_SIMD");
        command
    }

    /// Run it.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn run(&self, line: &str) -> Ran {
        Ran::of(line, &self.command(line).output().expect("the program starts"))
    }

    /// Run it and see it succeed.
    ///
    /// # Panics
    /// If it does not.
    #[must_use]
    pub fn succeed(&self, line: &str) -> Ran {
        self.run(line).succeeded()
    }

    /// Run it with `--json` and read the summary.
    ///
    /// # Panics
    /// If it fails, or prints anything but one line of JSON.
    #[must_use]
    pub fn summary(&self, line: &str) -> Value {
        let ran = self.succeed(&format!("{line} --json"));
        assert_eq!(ran.stdout.lines().count(), 1, "{ran:?}");
        serde_json::from_str(&ran.stdout).expect("the summary is JSON")
    }

    /// Header and numbers of a table that was written, row by row.
    ///
    /// # Panics
    /// If the file is none.
    #[must_use]
    pub fn table(&self, name: &str) -> (String, Vec<Vec<f64>>) {
        let text = std::fs::read_to_string(self.path(name)).expect("the table can be read");
        let (header, rows) = text.split_once('\n').expect("the table has a header");
        let number = |text: &str| text.parse().expect("the table holds numbers");
        let row = |line: &str| line.split(',').map(number).collect();
        (header.to_owned(), rows.lines().map(row).collect())
    }
}

/// Names of all that is in a folder, in order.
///
/// # Panics
/// If it cannot be read.
#[must_use]
pub fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("the folder can be read");
    let name = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.expect("an entry").file_name().to_string_lossy().into_owned()
    };
    let mut names: Vec<String> = entries.map(name).collect();
    names.sort();
    names
}

/// What a run left.
#[derive(Clone, Debug)]
pub struct Ran {
    /// The arguments.
    pub line: String,
    /// Exit status; none if a signal ended it.
    pub status: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Ran {
    /// From the output of a process.
    #[must_use]
    pub fn of(line: &str, output: &Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self {
            line: line.to_owned(),
            status: output.status.code(),
            stdout: text(&output.stdout),
            stderr: text(&output.stderr),
        }
    }

    /// See that it succeeded in silence on standard error.
    ///
    /// # Panics
    /// If it did not.
    #[must_use]
    pub fn succeeded(self) -> Self {
        assert_eq!((self.status, self.stderr.as_str()), (Some(0), ""), "{self:?}");
        self
    }

    /// See that it was refused with `status` and one line on standard error that holds all of
    /// `words`, and without a panic.
    ///
    /// # Panics
    /// If it was not.
    pub fn refused(&self, status: i32, words: &[&str]) {
        assert!(!self.stderr.contains("panicked"), "{self:?}");
        assert_eq!(self.status, Some(status), "{self:?}");
        assert_eq!(self.stderr.lines().count(), 1, "more than one line: {self:#?}");
        for word in words {
            assert!(self.stderr.contains(word), "'{word}' is missing: {self:?}");
        }
    }
}
