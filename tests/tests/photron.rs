//! Real camera recordings, decoded as pyMRAW decodes them, and what the program says about them.

use phasewalk::io::open_raw;
use phasewalk::io::photron::{PhotronImages, PhotronWriter};
use phasewalk_tests::program::Bench;
use std::fs;
use std::path::PathBuf;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("data/photron").join(name)
}

/// Names, numbers of the image, and the sums of `expected.csv`.
fn expected() -> Vec<(String, usize, [u64; 3])> {
    let table = fs::read_to_string(data("expected.csv")).unwrap();
    let line = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |i: usize| fields[i].parse().unwrap();
        (fields[0].to_owned(), number(1) as usize, [2, 3, 4].map(number))
    };
    table.lines().skip(1).map(line).collect()
}

fn sums(counts: &[u16]) -> [u64; 3] {
    let counts = counts.iter().map(|&count| u64::from(count));
    let weighted = counts.clone().zip(1..).map(|(count, weight)| weight * count).sum();
    [counts.clone().sum(), weighted, counts.max().unwrap_or(0)]
}

#[test]
fn decoded_as_the_peer_decodes_them() {
    let mut recordings = Vec::new();
    for (name, image, expected) in expected() {
        let raw = open_raw(&data(&name)).unwrap();
        let format = raw.format();
        let mut counts = vec![0; format.height * format.width];
        raw.read(image..image + 1, 0..format.height, &mut counts).unwrap();
        assert_eq!(sums(&counts), expected, "{name}, image {image}");
        assert_eq!(format.bits, 12);
        recordings.push((name, image + 1));
        // The same, a few rows at a time.
        let mut strip = vec![0; 10 * format.width];
        for (number, rows) in counts.chunks(10 * format.width).enumerate() {
            let strip = &mut strip[..rows.len()];
            let top = number * 10;
            raw.read(image..image + 1, top..top + rows.len() / format.width, strip).unwrap();
            assert_eq!(strip, rows);
        }
    }
    for (name, images) in [("ball_12bit.cihx", 1), ("beam.cihx", 4), ("sample_60k_16bit.cih", 1)] {
        assert_eq!(open_raw(&data(name)).unwrap().format().images, images);
        assert!(recordings.contains(&(name.to_owned(), images)), "{name}");
    }
}

#[test]
fn what_the_cameras_wrote_in_their_headers() {
    let header = |name: &str| PhotronImages::open(&data(name)).unwrap().header().clone();
    let ball = header("ball_12bit.cihx");
    assert_eq!((ball.height, ball.width, ball.rate_hz), (384, 384, Some(30_000.0)));
    assert_eq!((ball.shutter_s, ball.start_image, ball.save_step), (Some(20e-6), 52, 1));
    assert_eq!(ball.device, "FASTCAM Nova S16 type 1100K-M-64GB 10GbE model");
    assert_eq!((ball.date.as_str(), ball.time.as_str()), ("2023/1/18", "11:56:13"));
    let beam = header("beam.cihx");
    assert_eq!((beam.height, beam.width, beam.rate_hz), (80, 1024, Some(50_000.0)));
    assert_eq!((beam.shutter_s, beam.recorded_images, beam.save_step), (Some(5e-6), 400, 2500));
    let sample = header("sample_60k_16bit.cih");
    assert_eq!((sample.height, sample.width, sample.rate_hz), (368, 896, Some(60_000.0)));
    assert_eq!((sample.shutter_s, sample.start_image), (Some(1.0 / 800_000.0), 49_300));
    assert_eq!((sample.recorded_images, sample.save_step), (677, 36));
    assert_eq!(sample.image_rate_hz(), Some(60_000.0 / 36.0));
    assert_eq!(
        (sample.device.as_str(), sample.comment.as_str()),
        ("FASTCAM SA-Z type 2100K-M-64GB", "first test",)
    );
}

/// Read and written again, the images are the same bytes.
#[test]
fn written_again_they_are_the_same() {
    let bench = Bench::new();
    for name in ["ball_12bit.cihx", "beam.cihx", "sample_60k_16bit.cih"] {
        let original = PhotronImages::open(&data(name)).unwrap();
        let header = original.header().clone();
        for copy in ["copy.cih", "copy.cihx"] {
            let mut writer = PhotronWriter::create(&bench.path(copy), header.clone()).unwrap();
            phasewalk::io::visit_images(&original, |counts| writer.push(counts)).unwrap();
            let files = writer.finish().unwrap();
            let images = fs::read(data(name).with_extension("mraw")).unwrap();
            assert!(fs::read(&files[1]).unwrap() == images, "{name}");
            assert_eq!(PhotronImages::open(&files[0]).unwrap().header(), &header);
            files.iter().for_each(|file| fs::remove_file(file).unwrap());
        }
    }
}

#[test]
fn info_says_what_was_recorded() {
    let bench = Bench::new();
    for file in ["ball_12bit.cihx", "ball_12bit.mraw"] {
        fs::copy(data(file), bench.path(file)).unwrap();
    }
    for file in ["ball_12bit.cihx", "ball_12bit.mraw"] {
        let text = bench.succeed(&format!("info {file}")).stdout;
        for words in ["uint12 (image 1, y 384, x 384)", "30000", "Nova S16", "\"whole\""] {
            assert!(text.contains(words), "{words}: {text}");
        }
        let facts = bench.summary(&format!("info {file}"));
        assert_eq!(facts["arrays"][0]["shape"], serde_json::json!([1, 384, 384]));
        assert_eq!(facts["attributes"]["shutter_s"], 20e-6);
        assert_eq!(facts["attributes"]["images_bytes_found"], 221_184);
    }
    fs::write(bench.path("ball_12bit.mraw"), [0; 1000]).unwrap();
    let text = bench.succeed("info ball_12bit.cihx").stdout;
    assert!(text.contains("cut short: 0 whole images of 1"), "{text}");
    fs::remove_file(bench.path("ball_12bit.mraw")).unwrap();
    assert!(bench.succeed("info ball_12bit.cihx").stdout.contains("\"missing\""));
    fs::write(bench.path("bad.cihx"), "text").unwrap();
    bench.run("info bad.cihx").refused(1, &["bad.cihx", "no CIHX header"]);
    bench.run("info no.mraw").refused(1, &["no.mraw", "no such file"]);
    fs::write(bench.path("alone.mraw"), [0; 9]).unwrap();
    bench.run("info alone.mraw").refused(1, &["alone.mraw", "no .cihx or .cih"]);
}
