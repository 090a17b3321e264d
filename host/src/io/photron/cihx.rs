//! CIHX, a camera header in XML inside a small binary container.
//!
//! ```text
//! byte   0  "!!! This file can not be edited. !!!", then zeros
//!      256  "CIHX", u32 1, u32 2 (number of entries)
//!      268  entry of the XML: u64 0, u64 316 (where), u64 length
//!      292  entry of the trailer: u64 4, u64 where (the end of the XML), u64 length, may be 0
//!      316  XML, lines end in CR LF; `<cih>` at 356
//! ```
//! Numbers are little-endian. The trailer is not understood and not needed.

use super::fields::{Fields, Keys, one_line, shortened};
use super::header::CameraHeader;
use crate::error::{Error, Result};
use roxmltree::{Document, Node};
use std::path::Path;

const BANNER: &[u8] = b"!!! This file can not be edited. !!!";
const MAGIC_AT: usize = 256;
const MAGIC: &[u8] = b"CIHX";
const XML_END_AT: usize = 300;
const XML_AT: usize = 316;

/// Elements of a camera's own headers: about 400.
const MOST_NODES: u32 = 100_000;

const KEYS: Keys = Keys {
    file_format: "imageFileInfo/fileFormat",
    width: "imageDataInfo/resolution/width",
    height: "imageDataInfo/resolution/height",
    images: "frameInfo/totalFrame",
    stored_bits: "imageDataInfo/colorInfo/bit",
    effective_bits: "imageDataInfo/effectiveBit/depth",
    side: "imageDataInfo/effectiveBit/side",
    color: "imageDataInfo/colorInfo/type",
    rate_hz: "recordInfo/recordRate",
    save_step: "frameInfo/skipFrame",
    recorded_images: "frameInfo/recordedFrame",
    start_image: "frameInfo/startFrame",
    device: "deviceInfo/deviceName",
    comment: "basicInfo/comment",
    date: "fileInfo/date",
    time: "fileInfo/time",
};

/// One over the exposure time in seconds.
const SHUTTER_SPEED: &str = "recordInfo/shutterSpeed";
/// The exposure time in nanoseconds.
const SHUTTER_NS: &str = "recordInfo/shutterSpeedNsec";

/// Read a header; `path` is for messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<CameraHeader> {
    // A comment in another encoding must not cost the numbers.
    let text = String::from_utf8_lossy(xml(path, bytes)?);
    let options = roxmltree::ParsingOptions { nodes_limit: MOST_NODES, ..Default::default() };
    let document = Document::parse_with_options(&text, options).map_err(|error| {
        damaged(path, format!("its XML is broken: {}", shortened(&error.to_string())))
    })?;
    let root = document.root_element();
    let name = root.tag_name().name();
    if name != "cih" {
        return Err(damaged(path, format!("its XML holds <{}>", shortened(name))));
    }
    let text =
        |key: &str| element(root, key).map(|node| node.text().unwrap_or("").trim().to_owned());
    let fields = Fields { path, text: &text };
    let nanoseconds = fields.optional::<f64>(SHUTTER_NS).filter(|&ns| ns > 0.0);
    let shutter_s = nanoseconds.map(|ns| ns / 1e9);
    let shutter_s = shutter_s.or_else(|| Some(1.0 / fields.optional::<f64>(SHUTTER_SPEED)?));
    fields.header(&KEYS, shutter_s)
}

/// The bytes of the XML.
fn xml<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a [u8]> {
    if !bytes.starts_with(BANNER) || !bytes[MAGIC_AT.min(bytes.len())..].starts_with(MAGIC) {
        return Err(Error::file(path, "is no CIHX header of a camera: give the file it saved"));
    }
    let end = bytes
        .get(XML_END_AT..)
        .and_then(|rest| rest.first_chunk())
        .map_or(0, |number| u64::from_le_bytes(*number));
    usize::try_from(end).ok().and_then(|end| bytes.get(XML_AT..end)).ok_or_else(|| {
        damaged(path, format!("its XML should end at byte {end}, the file has {}", bytes.len()))
    })
}

fn element<'a, 'input>(root: Node<'a, 'input>, path: &str) -> Option<Node<'a, 'input>> {
    path.split('/')
        .try_fold(root, |node, name| node.children().find(|child| child.has_tag_name(name)))
}

fn damaged(path: &Path, what: String) -> Error {
    Error::file(path, format!("the CIHX header is damaged, {what}: copy it again"))
}

/// The header in its container.
pub(super) fn print(header: &CameraHeader) -> Vec<u8> {
    let xml = print_xml(header);
    let mut bytes = BANNER.to_vec();
    bytes.resize(MAGIC_AT, 0);
    bytes.extend(MAGIC);
    bytes.extend([1_u32, 2].iter().flat_map(|n| n.to_le_bytes()));
    let (start, length) = (XML_AT as u64, xml.len() as u64);
    let entries = [0, start, length, 4, start + length, 0];
    bytes.extend(entries.iter().flat_map(|n: &u64| n.to_le_bytes()));
    bytes.extend(xml.as_bytes());
    bytes
}

/// The facts that readers look for; the camera's own headers hold ten times as many.
fn print_xml(header: &CameraHeader) -> String {
    let text = |text: &str| escape(&one_line(text));
    let number = |number: f64| without_rounding_error(number).to_string();
    let (width, height) = (header.width.to_string(), header.height.to_string());
    print_elements(&[
        ("fileInfo/version", "1.0".to_owned()),
        (KEYS.date, text(&header.date)),
        (KEYS.time, text(&header.time)),
        (KEYS.file_format, "Mraw".to_owned()),
        ("imageFileInfo/resolution/width", width.clone()),
        ("imageFileInfo/resolution/height", height.clone()),
        (KEYS.width, width),
        (KEYS.height, height),
        (KEYS.color, "Mono".to_owned()),
        (KEYS.stored_bits, header.packing.bits().to_string()),
        (KEYS.effective_bits, header.effective_bits.to_string()),
        (KEYS.side, header.side.word().to_owned()),
        (KEYS.recorded_images, header.recorded_images.to_string()),
        (KEYS.images, header.images.to_string()),
        (KEYS.start_image, header.start_image.to_string()),
        (KEYS.save_step, header.save_step.to_string()),
        (KEYS.comment, text(&header.comment)),
        (KEYS.rate_hz, header.rate_hz.unwrap_or(0.0).to_string()),
        (SHUTTER_SPEED, number(header.shutter_s.map_or(0.0, |s| 1.0 / s))),
        (SHUTTER_NS, number(header.shutter_s.map_or(0.0, |s| s * 1e9))),
        (KEYS.device, text(&header.device)),
    ])
}

/// Elements by their paths below the root; neighbours share what their paths have in common.
fn print_elements(elements: &[(&str, String)]) -> String {
    let mut xml = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\r\n".to_owned();
    let mut open: Vec<&str> = Vec::new();
    for (path, text) in elements {
        let path: Vec<&str> = std::iter::once("cih").chain(path.split('/')).collect();
        let [groups @ .., name] = path.as_slice() else { continue };
        let shared = open.iter().zip(groups).take_while(|(a, b)| a == b).count();
        close(&mut xml, &mut open, shared);
        for group in &groups[shared..] {
            xml += &format!("{}<{group}>\r\n", indent(open.len()));
            open.push(group);
        }
        xml += &format!("{}<{name}>{text}</{name}>\r\n", indent(open.len()));
    }
    close(&mut xml, &mut open, 0);
    xml
}

/// End the open elements from the innermost outwards, until `depth` are left.
fn close(xml: &mut String, open: &mut Vec<&str>, depth: usize) {
    while open.len() > depth
        && let Some(group) = open.pop()
    {
        *xml += &format!("{}</{group}>\r\n", indent(open.len()));
    }
}

fn indent(depth: usize) -> String {
    "    ".repeat(depth)
}

/// 20000 and not 20000.000000000004.
fn without_rounding_error(number: f64) -> f64 {
    (number * 1e6).round() / 1e6
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
