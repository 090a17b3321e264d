//! QEMU's debugger (gdb's remote protocol): the one way to change the board's memory.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(5);

/// Write bytes into the memory; the machine stands still meanwhile and goes on afterwards.
pub fn poke(socket: &Path, address: u32, bytes: &[u8]) {
    let mut stream = UnixStream::connect(socket).expect("QEMU's debugger listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket has timeouts");
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    order(&mut stream, &format!("M{address:x},{:x}:{hex}", bytes.len()));
    order(&mut stream, "D");
}

/// `$packet#sum`, answered by `+$OK#9a`.
fn order(stream: &mut UnixStream, packet: &str) {
    let sum = packet.bytes().fold(0_u8, u8::wrapping_add);
    write!(stream, "${packet}#{sum:02x}").expect("the debugger listens");
    let mut answer = Vec::new();
    while !answer.ends_with(b"#9a") {
        let mut byte = [0];
        stream.read_exact(&mut byte).expect("the debugger answers");
        answer.push(byte[0]);
    }
    assert!(answer.ends_with(b"$OK#9a"), "{packet}: {}", String::from_utf8_lossy(&answer));
}
