//! Damaged, missing and foreign files: one clear line each.

use super::*;

#[test]
fn sizes_that_disagree() {
    let folder = TempDir::new().unwrap();
    for name in ["a.cih", "b.cihx"] {
        let (header, images) = recording(&folder, name);
        for (bytes, words) in [
            (35, ["cut short: 2 whole images of 3", "35 bytes"]),
            (11, ["cut short: 0 whole images of 3", "wants 36"]),
            (0, ["empty", name]),
            (48, ["too long: room for 4 images", "48 bytes"]),
            (37, ["too long: room for 3 images", name]),
        ] {
            fs::write(&images, vec![0; bytes]).unwrap();
            for opened in [&header, &images] {
                let text = refusal(open_raw(opened), &images);
                words.iter().for_each(|word| assert!(text.contains(word), "{text}"));
            }
            let said = describe(&header).unwrap().to_string();
            assert!(said.contains(words[0].split(':').next().unwrap()), "{said}");
        }
        fs::remove_file(&images).unwrap();
        assert!(refusal(open_raw(&header), &images).contains("are missing"));
        assert!(refusal(open_raw(&images), &images).contains("no such file"));
        assert!(describe(&header).unwrap().to_string().contains("images_state = \"missing\""));
        fs::create_dir(&images).unwrap();
        assert!(refusal(open_raw(&header), &images).contains("not an ordinary file"));
    }
}

#[test]
fn a_recording_that_shrinks_while_it_is_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.cihx");
    // The small piece is copied, the large one mapped.
    for height in [2, 1024] {
        let header = CameraHeader::new(2, height, 256, Packing::Bits16);
        write(&path, &header, &vec![1; 2 * height * 256]).unwrap();
        let raw = open_raw(&path).unwrap();
        let images = path.with_extension("mraw");
        fs::OpenOptions::new().write(true).open(&images).unwrap().set_len(100).unwrap();
        let mut out = vec![0; height * 256];
        let text = refusal(raw.read(1..2, 0..height, &mut out), &images);
        assert!(text.contains("has shrunk") && text.contains("to 100 bytes"), "{text}");
    }
}

#[test]
fn files_that_are_not_there_or_something_else() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (header, images) = recording(&folder, "a.cih");
    fs::remove_file(&header).unwrap();
    assert!(refusal(open_raw(&images), &images).contains("no .cihx or .cih header beside it"));
    assert!(refusal(open_raw(&header), &header).contains("no such file"));
    for (name, content, words) in [
        ("text.cih", "Total Frame : 3\n", "first line"),
        ("text.cihx", CIH, "no CIHX"),
        ("empty.cih", "", "empty"),
        ("empty.cihx", "", "empty"),
        ("run.tif", "", "unknown kind"),
        ("run", "", "unknown kind"),
    ] {
        fs::write(at(name), content).unwrap();
        let text = refusal(open_raw(&at(name)), &at(name));
        assert!(text.contains(words), "{text}");
    }
    fs::create_dir(at("folder.cihx")).unwrap();
    assert!(refusal(open_raw(&at("folder.cihx")), &at("folder.cihx")).contains("ordinary file"));
    let huge = fs::File::create(at("huge.cih")).unwrap();
    huge.set_len(1 << 40).unwrap();
    assert!(refusal(open_raw(&at("huge.cih")), &at("huge.cih")).contains("too many"));
}

/// What each wrong number or word in a header is answered with, in both kinds.
#[test]
fn headers_with_impossible_facts() {
    let path = Path::new("h");
    let good = full_header(2, 1, 4, Packing::Bits12);
    let xml = String::from_utf8(cihx::print(&good)[316..].to_vec()).unwrap();
    for (key, tag, value, words) in [
        ("Total Frame", "totalFrame", "0", "number of images is 0"),
        ("Total Frame", "totalFrame", "1000000000000000000", "number of images is 10000000"),
        ("Total Frame", "totalFrame", "99999999999999999999999", "cannot be"),
        ("Total Frame", "totalFrame", "-3", "'-3'"),
        ("Total Frame", "totalFrame", "many", "'many'"),
        ("Total Frame", "totalFrame", "", "is missing"),
        ("Image Width", "width", "0", "image width is 0"),
        ("Image Width", "width", "1000000000000000000", "image width is 1000000"),
        ("Image Width", "width", "3", "whole bytes"),
        ("Image Height", "height", "4e3", "'4e3'"),
        ("Image Height", "height", "", "is missing"),
        ("Color Bit", "bit", "24", "24 bits per pixel"),
        ("Color Bit", "bit", "0", "0 bits per pixel"),
        ("Color Type", "type", "Color", "colour type 'Color'"),
        ("EffectiveBit Depth", "depth", "0", "0 effective bits"),
        ("EffectiveBit Depth", "depth", "1000000", "1000000 effective bits"),
        ("EffectiveBit Side", "side", "Left", "'Left'"),
        ("EffectiveBit Side", "side", "", "is missing"),
        ("File Format", "fileFormat", "Tiff", "saved as 'Tiff'"),
        ("File Format", "fileFormat", "", "is missing"),
        ("Record Rate(fps)", "recordRate", "-1", "'-1'"),
        ("Record Rate(fps)", "recordRate", "NaN", "'NaN'"),
        ("Record Rate(fps)", "recordRate", "1000000000000000000", "cannot be"),
    ] {
        let changed: Vec<String> = CIH
            .lines()
            .map(|line| match line.split_once(" : ") {
                Some((found, _)) if found == key => format!("{key} : {value}"),
                _ => line.to_owned(),
            })
            .collect();
        let said = refusal(cih::parse(path, changed.join("\n").as_bytes()), path);
        assert!(said.contains(words), "{said}");
        let said = refusal(cihx::parse(path, &container(&with_tag(&xml, tag, value))), path);
        assert!(said.contains(words), "{said}");
    }
}

/// A container with this XML.
fn container(xml: &str) -> Vec<u8> {
    let mut bytes = cihx::print(&full_header(2, 1, 4, Packing::Bits12));
    bytes.truncate(316);
    bytes.extend(xml.as_bytes());
    let end = bytes.len() as u64;
    ending_at(&bytes, end)
}

/// The container with another end of its XML.
fn ending_at(container: &[u8], end: u64) -> Vec<u8> {
    let mut bytes = container.to_vec();
    bytes[300..308].copy_from_slice(&end.to_le_bytes());
    bytes
}

/// The XML with another text in every element `tag`.
fn with_tag(xml: &str, tag: &str, value: &str) -> String {
    let (open, close) = (format!("<{tag}>"), format!("</{tag}>"));
    let mut pieces = xml.split(&open);
    let mut text = pieces.next().unwrap().to_owned();
    for piece in pieces {
        let (_, rest) = piece.split_once(&close).unwrap();
        text += &format!("{open}{value}{close}{rest}");
    }
    text
}

#[test]
fn damaged_containers() {
    let path = Path::new("h.cihx");
    let good = cihx::print(&full_header(2, 1, 4, Packing::Bits12));
    for end in [0, 315, good.len() as u64 + 1, 1_000_000_000_000_000_000, u64::MAX] {
        let text = refusal(cihx::parse(path, &ending_at(&good, end)), path);
        assert!(text.contains(&format!("byte {end}")), "{text}");
    }
    for end in [316, 320, 360, good.len() as u64 - 9] {
        let text = refusal(cihx::parse(path, &ending_at(&good, end)), path);
        assert!(text.contains("XML is broken"), "{text}");
    }
    assert!(refusal(cihx::parse(path, &container("<abc/>")), path).contains("<abc>"));
    let entity = "<!DOCTYPE cih [<!ENTITY a \"b\">]><cih/>".to_owned();
    let nested = "<a>".repeat(200_000);
    for xml in [entity, nested.clone(), nested + &"</a>".repeat(200_000)] {
        assert!(refusal(cihx::parse(path, &container(&xml)), path).contains("XML is broken"));
    }
}

/// Whatever byte is lost or changed, the answer is a header or one line.
#[test]
fn no_damage_ends_in_a_panic() {
    let header = full_header(2, 1, 4, Packing::Bits12);
    let path = Path::new("h");
    type Parse = fn(&Path, &[u8]) -> Result<CameraHeader>;
    for (bytes, parse) in
        [(cih::print(&header), cih::parse as Parse), (cihx::print(&header), cihx::parse)]
    {
        for cut in 0..bytes.len() {
            let _ = parse(path, &bytes[..cut]).map_err(|error| assert_one_line(&error.to_string()));
        }
        for place in 0..bytes.len() {
            for change in [1, 0x10, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[place] ^= change;
                let _ = parse(path, &damaged).map_err(|error| assert_one_line(&error.to_string()));
            }
        }
    }
}

fn assert_one_line(text: &str) {
    assert!(!text.contains('\n') && text.len() < 400, "{text}");
}
