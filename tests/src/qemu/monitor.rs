//! QEMU's monitor (QMP): the board's memory and the name of its line.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(10);

/// A conversation with the monitor.
pub struct Monitor {
    reader: BufReader<UnixStream>,
}

impl Monitor {
    /// Connect as soon as it listens.
    pub fn open(socket: &Path, child: &mut Child) -> Self {
        let begin = Instant::now();
        let stream = loop {
            if let Ok(stream) = UnixStream::connect(socket) {
                break stream;
            }
            let ended = child.try_wait().expect("QEMU can be asked");
            assert!(ended.is_none(), "QEMU has ended: {ended:?}");
            assert!(begin.elapsed() < PATIENCE, "QEMU's monitor does not listen");
            std::thread::sleep(Duration::from_millis(10));
        };
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket has timeouts");
        let mut monitor = Self { reader: BufReader::new(stream) };
        monitor.order(&json!({ "execute": "qmp_capabilities" }));
        monitor
    }

    /// The terminal behind a character device.
    pub fn port(&mut self, label: &str) -> String {
        let devices = self.order(&json!({ "execute": "query-chardev" }));
        let devices = devices.as_array().expect("a list of devices");
        let device = devices.iter().find(|device| device["label"] == label);
        let name =
            device.and_then(|device| device["filename"].as_str()).expect("the line is there");
        name.strip_prefix("pty:").expect("it is a terminal").to_owned()
    }

    /// Write bytes of the memory into a file.
    pub fn save(&mut self, address: u32, bytes: usize, file: &Path) {
        let arguments = json!({ "val": address, "size": bytes, "filename": file });
        self.order(&json!({ "execute": "pmemsave", "arguments": arguments }));
    }

    /// Give an order and wait for what it returns.
    fn order(&mut self, order: &Value) -> Value {
        let stream = self.reader.get_mut();
        writeln!(stream, "{order}").expect("the monitor listens");
        loop {
            let mut line = String::new();
            self.reader.read_line(&mut line).expect("the monitor answers");
            let answer: Value = serde_json::from_str(&line).expect("in JSON");
            assert!(answer.get("error").is_none(), "{order}: {answer}");
            if let Some(value) = answer.get("return") {
                return value.clone();
            }
        }
    }
}
