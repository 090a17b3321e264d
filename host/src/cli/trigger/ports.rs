//! `phasewalk trigger ports`: serial ports, and which of them a board may be at.

use crate::cli::{Common, print};
use crate::error::Result;
use crate::trigger::port::{self, Port};
use serde_json::json;

/// Options of `trigger ports`.
#[derive(Debug, clap::Args)]
pub struct Arguments {}

pub(super) fn run(_arguments: &Arguments, common: &Common) -> Result<()> {
    let ports = port::all()?;
    if common.json {
        print(&json!({ "ports": ports }).to_string());
    } else if ports.is_empty() {
        print("no serial port found: plug the board in (`--port sim:` is an emulated board)");
    } else {
        print(&table(&ports));
    }
    Ok(())
}

fn table(ports: &[Port]) -> String {
    let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
    let head = ["port", "usb", "product", "may be"].map(str::to_owned);
    let row = |port: &Port| {
        [port.path.clone(), or_dash(&port.usb), or_dash(&port.product), or_dash(&port.may_be)]
    };
    let rows: Vec<[String; 4]> = std::iter::once(head).chain(ports.iter().map(row)).collect();
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|text| text.chars().count()).max()
    };
    let widths = [0, 1, 2].map(|column| width(column).unwrap_or(0));
    let line = |[path, usb, product, may_be]: &[String; 4]| {
        let [a, b, c] = widths;
        format!("{path:a$}  {usb:b$}  {product:c$}  {may_be}")
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_has_columns() {
        let port = Port {
            path: "/dev/ttyACM0".to_owned(),
            usb: Some("2341:0043".to_owned()),
            product: None,
            serial: None,
            may_be: Some("Arduino Uno R3".to_owned()),
        };
        let expected = "port          usb        product  may be\n\
                        /dev/ttyACM0  2341:0043  -        Arduino Uno R3";
        assert_eq!(table(&[port]), expected);
    }
}
