//! Serial ports: which there are, which of them may have a board, and opening one.

use super::link::Link;
use crate::error::{Error, Result};
use serde::Serialize;
use serialport::{ClearBuffer, SerialPort, SerialPortType};
use std::path::Path;
use std::time::Duration;

/// Bits per second of the boards: divides their clocks without a rest.
pub const BAUD: u32 = 250_000;

/// Reading and writing return after this time without progress.
const TIMEOUT: Duration = Duration::from_millis(50);

/// A serial port of this computer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Port {
    /// Its device file.
    pub path: String,
    /// Vendor and product number, `2341:0043`; none if it is not at USB.
    pub usb: Option<String>,
    /// What the device calls itself.
    pub product: Option<String>,
    /// Its serial number.
    pub serial: Option<String>,
    /// What it may be, if its numbers are known.
    pub may_be: Option<String>,
}

/// USB numbers of boards and of the serial converters on them.
const KNOWN: [(u16, u16, &str); 13] = [
    (0x2341, 0x0043, "Arduino Uno R3"),
    (0x2341, 0x0001, "Arduino Uno"),
    (0x2341, 0x0243, "Arduino Uno R3"),
    (0x2A03, 0x0043, "Arduino Uno R3"),
    (0x2A03, 0x0001, "Arduino Uno"),
    (0x1A86, 0x7523, "Uno-compatible board with CH340, or a converter"),
    (0x1A86, 0x5523, "Uno-compatible board with CH341, or a converter"),
    (0x0403, 0x6001, "board with FTDI FT232R, or a converter"),
    (0x0403, 0x6015, "board with FTDI FT231X, or a converter"),
    (0x10C4, 0xEA60, "board with CP2102, or a converter"),
    (0x0483, 0x374B, "STM32 Nucleo board (ST-LINK)"),
    (0x0483, 0x374E, "STM32 Nucleo board (ST-LINK)"),
    (0x0483, 0x5740, "STM32 board with USB"),
];

/// All serial ports, by name.
///
/// # Errors
/// When the operating system does not list them.
pub fn all() -> Result<Vec<Port>> {
    // The library panics where this folder is missing, as in some containers.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Ok(Vec::new());
    }
    let found = serialport::available_ports()
        .map_err(|error| Error::failed(format!("cannot list the serial ports: {error}")))?;
    let mut ports: Vec<Port> = found.into_iter().map(describe).collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

fn describe(info: serialport::SerialPortInfo) -> Port {
    let path = info.port_name;
    let SerialPortType::UsbPort(usb) = info.port_type else {
        return Port { path, usb: None, product: None, serial: None, may_be: None };
    };
    let known = KNOWN.iter().find(|(vendor, product, _)| (usb.vid, usb.pid) == (*vendor, *product));
    Port {
        path,
        usb: Some(format!("{:04x}:{:04x}", usb.vid, usb.pid)),
        product: usb.product,
        serial: usb.serial_number,
        may_be: known.map(|(_, _, what)| (*what).to_owned()),
    }
}

/// The one port that may have a board.
///
/// # Errors
/// When there is none or more than one; the message names them. Ports are not tried one after the
/// other: opening one resets the Arduino behind it, whatever that is doing.
pub fn the_board() -> Result<String> {
    choose(&all()?)
}

fn choose(ports: &[Port]) -> Result<String> {
    let boards: Vec<&Port> = ports.iter().filter(|port| port.may_be.is_some()).collect();
    match boards.as_slice() {
        [port] => Ok(port.path.clone()),
        [] if ports.is_empty() => Err(Error::failed(
            "no serial port found: plug the board in, or name its port with --port (`sim:` is an \
             emulated board)",
        )),
        [] => Err(Error::failed(format!(
            "no board found by its USB number; there are the ports {}: name one with --port",
            names(ports.iter())
        ))),
        several => Err(Error::failed(format!(
            "several ports may have a board: {}; name one with --port",
            names(several.iter().copied())
        ))),
    }
}

fn names<'a>(ports: impl Iterator<Item = &'a Port>) -> String {
    let name = |port: &Port| match &port.may_be {
        Some(what) => format!("{} ({what})", port.path),
        None => port.path.clone(),
    };
    ports.map(name).collect::<Vec<_>>().join(", ")
}

/// Open a serial port or pseudo-terminal.
///
/// # Errors
/// When it cannot be opened; the message says what to do.
pub fn open(path: &str, baud: u32) -> Result<Link> {
    let port = serialport::new(path, baud).timeout(TIMEOUT).open();
    let port = port.map_err(|error| cannot_open(path, baud, &error))?;
    // What an earlier run has left there is nobody's answer.
    let _ = port.clear(ClearBuffer::All);
    let reader: Box<dyn SerialPort> = port.try_clone().map_err(|error| {
        Error::failed(format!("{path}: cannot be read and written at once: {error}"))
    })?;
    Ok(Link::new(Box::new(reader), Box::new(port)))
}

fn cannot_open(path: &str, baud: u32, error: &serialport::Error) -> Error {
    use serialport::ErrorKind::{InvalidInput, Io, NoDevice};
    use std::io::ErrorKind::{NotFound, PermissionDenied, WouldBlock};
    let what = match error.kind {
        Io(NotFound) => "no such port: `phasewalk trigger ports` lists them".to_owned(),
        Io(PermissionDenied) => {
            "no permission: add yourself to the group `dialout` (sudo usermod -aG dialout $USER) \
             and log in again"
                .to_owned()
        }
        NoDevice | Io(WouldBlock) => {
            "in use by another program (a run, a serial monitor), or no device: end that program"
                .to_owned()
        }
        InvalidInput => format!("does not do {baud} baud: give another --baud"),
        _ => format!("cannot be opened as a serial port: {error}"),
    };
    Error::failed(format!("{path}: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(path: &str, may_be: Option<&str>) -> Port {
        let may_be = may_be.map(str::to_owned);
        Port { path: path.to_owned(), usb: None, product: None, serial: None, may_be }
    }

    #[test]
    fn one_board_is_chosen_and_several_are_named() {
        let (uno, other) = (port("/dev/ttyACM0", Some("Arduino Uno")), port("/dev/ttyS0", None));
        assert_eq!(choose(&[other.clone(), uno.clone()]).unwrap(), "/dev/ttyACM0");
        let second = port("/dev/ttyUSB0", Some("board with CP2102, or a converter"));
        let message = choose(&[uno, other.clone(), second]).unwrap_err().to_string();
        for words in ["/dev/ttyACM0", "/dev/ttyUSB0", "CP2102", "--port"] {
            assert!(message.contains(words), "{message}");
        }
        assert!(!message.contains("ttyS0"), "{message}");
        let message = choose(&[other]).unwrap_err().to_string();
        assert!(message.contains("/dev/ttyS0"), "{message}");
        assert!(choose(&[]).unwrap_err().to_string().contains("plug"));
    }
}
