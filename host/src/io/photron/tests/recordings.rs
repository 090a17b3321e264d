//! Whole recordings, written, read and described.

use super::*;

#[test]
fn any_rows_of_any_images() {
    let folder = TempDir::new().unwrap();
    let (images, height, width) = (5, 8, 7);
    for (name, packing, bits, side) in [
        ("a.cih", Packing::Bits8, 8, Side::Lower),
        ("b.cihx", Packing::Bits12, 12, Side::Lower),
        ("c.cih", Packing::Bits16, 16, Side::Lower),
        ("d.cihx", Packing::Bits16, 12, Side::Lower),
        ("e.cihx", Packing::Bits16, 12, Side::Higher),
        ("f.cih", Packing::Bits12, 10, Side::Higher),
    ] {
        let mut header = full_header(images, height, width, packing);
        (header.effective_bits, header.side) = (bits, side);
        let all = counts(images * height * width, bits);
        let path = folder.path().join(name);
        let mut writer = PhotronWriter::create(&path, header).unwrap();
        let (first, rest) = all.split_at(height * width);
        writer.push(first).unwrap();
        writer.push(&[]).unwrap();
        writer.push(rest).unwrap();
        let files = writer.finish().unwrap();
        for opened in [&files[0], &files[1]] {
            let raw = open_raw(opened).unwrap();
            assert_eq!(raw.format().bits, bits);
            assert_eq!(raw.format().rate_hz, Some(20_000.0));
            for from in 0..images {
                for top in 0..height {
                    let (to, bottom) = (images.min(from + 3), height.min(top + 3));
                    let mut out = vec![0; (to - from) * (bottom - top) * width];
                    raw.read(from..to, top..bottom, &mut out).unwrap();
                    let expected = (from..to).flat_map(|image| {
                        &all[(image * height + top) * width..(image * height + bottom) * width]
                    });
                    assert!(out.iter().eq(expected), "{name} {from} {top}");
                }
            }
            let mut out = vec![0; all.len()];
            raw.read(0..images, 0..height, &mut out).unwrap();
            assert_eq!(out, all, "{name}");
        }
    }
    let higher = fs::read(folder.path().join("e.mraw")).unwrap();
    assert!(higher.chunks(2).all(|pair| pair[0] & 15 == 0), "the lower bits are free");
}

/// Large enough to be mapped, in windows whose seams lie inside rows.
#[test]
fn windows_of_a_large_recording() {
    let folder = TempDir::new().unwrap();
    let (images, height, width) = (3, 1000, 1001);
    for (name, packing) in [("a.cihx", Packing::Bits12), ("b.cihx", Packing::Bits16)] {
        let all = counts(images * height * width, packing.bits());
        let path = folder.path().join(name);
        write(&path, &CameraHeader::new(images, height, width, packing), &all).unwrap();
        let raw = open_raw(&path).unwrap();
        let mut out = vec![0; all.len()];
        raw.read(0..images, 0..height, &mut out).unwrap();
        assert!(out == all, "{name}");
        let mut out = vec![0; 2 * 997 * width];
        raw.read(1..3, 3..1000, &mut out).unwrap();
        for (image, rows) in out.chunks(997 * width).enumerate() {
            assert!(rows == &all[((image + 1) * height + 3) * width..][..997 * width], "{name}");
        }
    }
}

#[test]
fn requests_outside_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.cihx");
    write(&path, &CameraHeader::new(2, 4, 4, Packing::Bits8), &[0; 32]).unwrap();
    let raw = open_raw(&path).unwrap();
    let mut out = [0; 16];
    assert!(raw.read(1..3, 0..2, &mut out).is_err());
    assert!(raw.read(0..1, 3..5, &mut out).is_err());
    assert!(raw.read(0..1, 0..3, &mut out).is_err());
    raw.read(1..1, 0..4, &mut []).unwrap();
    raw.read(0..2, 2..2, &mut []).unwrap();
    raw.read(1..2, 0..4, &mut out).unwrap();
}

#[test]
fn a_writer_takes_what_it_was_told() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.cihx");
    let images = folder.path().join("a.mraw");
    let header = CameraHeader { effective_bits: 12, ..CameraHeader::new(2, 2, 2, Packing::Bits16) };
    let mut writer = PhotronWriter::create(&path, header.clone()).unwrap();
    let text = refusal(writer.push(&[0, 0, 4096, 0]), &images);
    assert!(text.contains("4096") && text.contains("12 bits"), "{text}");
    assert!(refusal(writer.push(&[0; 6]), &images).contains("no whole images"));
    assert!(refusal(writer.push(&[0; 12]), &images).contains("3 images"));
    writer.push(&[4095; 4]).unwrap();
    assert!(refusal(writer.finish(), &images).contains("1 of 2 images"));
    assert!(names(&folder).is_empty());
    drop(PhotronWriter::create(&path, header.clone()).unwrap());
    assert!(names(&folder).is_empty());

    let create = |name: &str, header: &CameraHeader| {
        PhotronWriter::create(&folder.path().join(name), header.clone()).err().unwrap().to_string()
    };
    assert!(create("a.mraw", &header).contains("give .cihx or .cih"));
    assert!(create("missing/a.cih", &header).contains("does not exist"));
    let ten = CameraHeader::new(2, 2, 2, Packing::Bits10);
    assert!(create("a.cih", &ten).contains("10 bits are read only"));
    let odd = CameraHeader::new(2, 3, 3, Packing::Bits12);
    assert!(create("a.cih", &odd).contains("whole bytes"));
    let none = CameraHeader::new(0, 2, 2, Packing::Bits16);
    assert!(create("a.cih", &none).contains("number of images is 0"));
    write(&path, &header, &[0; 8]).unwrap();
    assert!(create("a.cih", &header).contains("another recording"));
    assert_eq!(names(&folder), ["a.cihx", "a.mraw"]);
}

#[test]
fn info_names_the_facts() {
    let folder = TempDir::new().unwrap();
    let (header, images) = recording(&folder, "a.cihx");
    for opened in [&header, &images] {
        let description = describe(opened).unwrap();
        let text = description.to_string();
        for words in [
            "Photron recording (CIHX, MRAW)",
            "uint12 (image 3, y 2, x 4)",
            "camera = \"FASTCAM SA-Z\"",
            "record_rate_hz = 60000.0",
            "image_rate_hz = 20000.0",
            "shutter_s = 1.25e-6",
            "images_state = \"whole\"",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
        let sizes = [&header, &images].map(|file| fs::metadata(file).unwrap().len());
        assert_eq!(description.bytes, sizes.iter().sum::<u64>());
        assert!(
            serde_json::to_string(&description).unwrap().contains("\"images_bytes_wanted\":36")
        );
    }
}

/// The header that a recording names by its images: the richer one.
#[test]
fn cihx_goes_before_cih() {
    let folder = TempDir::new().unwrap();
    let (header, images) = recording(&folder, "a.cihx");
    fs::write(header.with_extension("cih"), "not read").unwrap();
    assert_eq!(PhotronImages::open(&images).unwrap().header().images, 3);
    let upper = folder.path().join("B.MRAW");
    fs::rename(&images, &upper).unwrap();
    fs::rename(&header, folder.path().join("B.CIHX")).unwrap();
    assert_eq!(open_raw(&upper).unwrap().format().images, 3);
    assert_eq!(open_raw(&folder.path().join("B.CIHX")).unwrap().format().images, 3);
}
