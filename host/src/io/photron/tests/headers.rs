//! Headers printed and parsed.

use super::*;

#[test]
fn a_small_recording_byte_by_byte() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("run.cih");
    let header = full_header(2, 1, 4, Packing::Bits12);
    let images = [0xabc, 0x123, 0, 0xfff, 1, 2, 3, 4];
    let files = write(&path, &header, &images).unwrap();
    assert_eq!(files, [path.clone(), folder.path().join("run.mraw")]);
    assert_eq!(fs::read_to_string(&path).unwrap(), CIH);
    let expected = [0xab, 0xc1, 0x23, 0, 0x0f, 0xff, 0, 0x10, 2, 0, 0x30, 4];
    assert_eq!(fs::read(&files[1]).unwrap(), expected);
    assert_eq!(names(&folder), ["run.cih", "run.mraw"]);
}

#[test]
fn the_container_of_the_xml() {
    let header = full_header(2, 1, 4, Packing::Bits12);
    let bytes = cihx::print(&header);
    assert_eq!(&bytes[..40], b"!!! This file can not be edited. !!!\0\0\0\0");
    assert_eq!(&bytes[256..268], b"CIHX\x01\0\0\0\x02\0\0\0");
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let length = bytes.len() as u64;
    assert_eq!([268, 276, 284].map(number), [0, 316, length - 316]);
    assert_eq!([292, 300, 308].map(number), [4, length, 0]);
    assert_eq!(&bytes[316..363], b"<?xml version=\"1.0\" encoding=\"utf-8\"?>\r\n<cih>\r\n");
    let xml = std::str::from_utf8(&bytes[316..]).unwrap();
    for line in [
        "<comment>x &lt; y &amp; z &gt; \"0\" : ü</comment>",
        "<shutterSpeed>800000</shutterSpeed>",
        "<shutterSpeedNsec>1250</shutterSpeedNsec>",
        "<startFrame>-20</startFrame>",
    ] {
        assert!(xml.contains(line), "{line}");
    }
    let frames = "    <frameInfo>\r\n        <recordedFrame>677</recordedFrame>\r\n";
    assert!(xml.contains(frames) && xml.ends_with("    </deviceInfo>\r\n</cih>\r\n"), "{xml}");
    assert_eq!(xml.matches("<imageDataInfo>").count(), 1);
    assert_eq!(xml.matches('\n').count(), xml.matches("\r\n").count());
}

#[test]
fn headers_come_back_as_they_went() {
    let path = Path::new("h");
    for packing in PACKINGS {
        for side in [Side::Lower, Side::Higher] {
            for shutter_s in [None, Some(1.0 / 800_000.0), Some(20e-6), Some(0.3)] {
                let header = CameraHeader {
                    side,
                    shutter_s,
                    effective_bits: packing.bits().min(12),
                    ..full_header(5, 8, 12, packing)
                };
                assert_eq!(cih::parse(path, &cih::print(&header)).unwrap(), header);
                assert_eq!(cihx::parse(path, &cihx::print(&header)).unwrap(), header);
            }
        }
    }
    let plain = CameraHeader::new(1, 2, 2, Packing::Bits16);
    assert_eq!(cih::parse(path, &cih::print(&plain)).unwrap(), plain);
    assert_eq!(cihx::parse(path, &cihx::print(&plain)).unwrap(), plain);
}

#[test]
fn texts_that_no_header_can_hold_become_blanks() {
    let path = Path::new("h");
    let comment = "two\nlines\u{0}\u{ffff}end\nTotal Frame : 9".to_owned();
    let header = CameraHeader { comment, ..full_header(2, 1, 4, Packing::Bits12) };
    for read in [
        cih::parse(path, &cih::print(&header)).unwrap(),
        cihx::parse(path, &cihx::print(&header)).unwrap(),
    ] {
        assert_eq!(read.comment, "two lines  end Total Frame : 9");
        assert_eq!(read.images, 2);
    }
}

/// Windows line ends, other encodings, sensor counts, unknown rates.
#[test]
fn what_cameras_write_otherwise() {
    let path = Path::new("h.cih");
    let windows = CIH.replace('\n', "\r\n").replace("Mono", "Raw").replace("MRaw", "mraw");
    assert_eq!(cih::parse(path, windows.as_bytes()).unwrap().images, 2);
    let mut latin = CIH.as_bytes().to_vec();
    latin.truncate(latin.len() - "ü\n\nEND".len());
    latin.extend(b"\xfc\n\nTotal Frame : 7");
    let header = cih::parse(path, &latin).unwrap();
    assert_eq!((header.images, header.comment.ends_with('\u{fffd}')), (2, true));
    let unknown = CIH.replace("60000", "0").replace("1/800000", "Unknown");
    let header = cih::parse(path, unknown.as_bytes()).unwrap();
    assert_eq!((header.rate_hz, header.shutter_s), (None, None));
    let header = cih::parse(path, CIH.as_bytes()).unwrap();
    assert_eq!(header.image_rate_hz(), Some(20_000.0));
    // A camera of 12 bits writes files of 8.
    let eight = CIH.replace("Color Bit : 12", "Color Bit : 8");
    assert_eq!(cih::parse(path, eight.as_bytes()).unwrap().significant_bits(), 8);
}
