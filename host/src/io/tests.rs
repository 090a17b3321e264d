//! Round trips, and everything that can be wrong with a file.

use super::npy::NpyWriter;
use super::*;
use crate::error::Error;
use num_complex::Complex64;
use serde_json::json;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use tempfile::TempDir;

/// A value that differs at every place.
fn value(t: usize, z: usize, y: usize, x: usize) -> Complex32 {
    Complex32::new((1000 * t + 100 * z + 10 * y + x) as f32 + 0.25, -(x as f32))
}

fn frame(t: usize, height: usize, width: usize) -> Vec<Complex32> {
    (0..height * width).map(|i| value(t, 0, i / width, i % width)).collect()
}

/// Everything in the folder, hidden names included.
fn names(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<_> =
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn npy_bytes(dictionary: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend_from_slice(&(dictionary.len() as u16).to_le_bytes());
    bytes.extend_from_slice(dictionary.as_bytes());
    bytes.extend_from_slice(data);
    bytes
}

fn dictionary(descr: &str, fortran: bool, shape: &str) -> String {
    let order = if fortran { "True" } else { "False" };
    format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n")
}

fn save(folder: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// The message of a failure, which is one line and names the file.
fn message<T>(result: Result<T>, path: &Path) -> String {
    let Err(error) = result else { panic!("{} was accepted", path.display()) };
    let text = error.to_string();
    assert!(!text.contains('\n'), "{text}");
    assert!(text.contains(&*path.file_name().unwrap().to_string_lossy()), "{text}");
    text
}

/// Every frame whole, and rows from the middle.
fn assert_holds_values(series: &dyn Series, expected: Shape) {
    assert_eq!(series.shape(), expected);
    let Shape { frames, depth, height, width } = expected;
    for t in 0..frames {
        for z in 0..depth {
            for rows in [0..height, 1..height - 1, 2..2] {
                let mut out = vec![Complex32::default(); rows.len() * width];
                series.read_rows(t, z, rows.clone(), &mut out).unwrap();
                for (i, found) in out.iter().enumerate() {
                    assert_eq!(*found, value(t, z, rows.start + i / width, i % width));
                }
            }
        }
    }
    let mut out = vec![Complex32::default(); width];
    assert!(series.read_rows(frames, 0, 0..1, &mut out).is_err());
    assert!(series.read_rows(0, depth, 0..1, &mut out).is_err());
    assert!(series.read_rows(0, 0, height..height + 1, &mut out).is_err());
    assert!(series.read_rows(0, 0, 0..2, &mut out).is_err());
}

fn write_field(path: &Path, frames: usize, height: usize, width: usize) -> Result<Vec<PathBuf>> {
    let layout = FieldLayout {
        frames,
        height,
        width,
        attributes: json!({"wavelength_nm": 841.0, "seed": 1}).as_object().unwrap().clone(),
        times_s: Some((0..frames).map(|t| 0.5 * t as f64).collect()),
    };
    let mask: Vec<bool> = (0..height * width).map(|i| i % 3 == 0).collect();
    let phase: Vec<f64> = (0..frames).map(|t| 0.1 * t as f64).collect();
    let truth = Truth { mask: &mask, phase_rad: &phase };
    let mut writer = FieldWriter::create(path, layout, truth)?;
    for t in 0..frames {
        writer.push_frame(&frame(t, height, width))?;
    }
    writer.finish()
}

#[test]
fn npy_field_round_trip() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("F.npy");
    let written = write_field(&path, 4, 7, 5).unwrap();
    assert_eq!(names(&folder), ["F.mask.npy", "F.npy", "F.phase.npy", "F.times.npy"]);
    assert_eq!(written.len(), 4);
    let series = open_series(&path).unwrap();
    assert_holds_values(&*series, Shape { frames: 4, depth: 1, height: 7, width: 5 });
    assert!(series.times_s().is_none() && series.wavelength_nm().is_none());
    let mask = read_mask(&written[1], 7, 5).unwrap();
    assert_eq!(mask, (0..35).map(|i| i % 3 == 0).collect::<Vec<_>>());
    assert_eq!(npy::read_f64_1d(&written[2]).unwrap(), [0.0, 0.1, 0.2, 0.1 * 3.0]);
    for path in written {
        assert_eq!(fs::metadata(path).unwrap().permissions().mode() & 0o600, 0o600);
    }
}

#[test]
fn results_have_the_permissions_of_any_new_file() {
    let folder = TempDir::new().unwrap();
    let ordinary = save(&folder, "ordinary", b"x");
    let result = folder.path().join("result.json");
    write_atomic(&result, b"{}").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&result), mode(&ordinary));
    let store = folder.path().join("F.zarr");
    write_field(&store, 2, 4, 4).unwrap();
    fs::create_dir(folder.path().join("ordinary_folder")).unwrap();
    assert_eq!(mode(&store), mode(&folder.path().join("ordinary_folder")));
}

#[test]
fn zarr_field_round_trip() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("F.zarr");
    // Higher than one chunk and not a multiple of it.
    write_field(&path, 3, 70, 5).unwrap();
    assert_eq!(names(&folder), ["F.zarr"]);
    for given in [path.clone(), path.join("field")] {
        let series = open_series(&given).unwrap();
        assert_holds_values(&*series, Shape { frames: 3, depth: 1, height: 70, width: 5 });
        assert_eq!(series.times_s(), Some(&[0.0, 0.5, 1.0][..]));
        assert_eq!(series.wavelength_nm(), Some(841.0));
    }
    assert_eq!(read_mask(&path, 70, 5).unwrap().len(), 350);
    assert_eq!(read_mask(&path.join("mask"), 70, 5).unwrap().len(), 350);
    assert_eq!(zarr::read_coordinate(&path.join("truth_phase_rad")).unwrap()[1], 0.1);
    assert!(message(open_series(&path.join("amplitude")), &path).contains("float32"));
    assert!(message(read_mask(&path.join("amplitude"), 70, 5), &path).contains("float32"));
}

#[test]
fn zarr_field_of_several_shards() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("F.zarr");
    // Three frames of 24 MB: two of them in the first shard.
    write_field(&path, 3, 1500, 2000).unwrap();
    let series = open_series(&path).unwrap();
    let mut out = vec![Complex32::default(); 2 * 2000];
    for t in 0..3 {
        series.read_rows(t, 0, 1498..1500, &mut out).unwrap();
        assert_eq!(out[2001], value(t, 0, 1499, 1));
    }
}

#[test]
fn npy_of_either_precision_order_and_endianness() {
    let folder = TempDir::new().unwrap();
    let (frames, depth, height, width) = (3, 2, 5, 4);
    let shape = Shape { frames, depth, height, width };
    for (bytes, big, fortran) in
        [(8, true, false), (16, false, false), (16, true, true), (8, false, true)]
    {
        let mut data = Vec::new();
        for i in 0..frames * depth * height * width {
            let (t, z, y, x) = if fortran {
                let (t, rest) = (i % frames, i / frames);
                let (z, rest) = (rest % depth, rest / depth);
                (t, z, rest % height, rest / height)
            } else {
                let (x, rest) = (i % width, i / width);
                let (y, rest) = (rest % height, rest / height);
                (rest / depth, rest % depth, y, x)
            };
            let v = value(t, z, y, x);
            for part in [v.re, v.im] {
                match (bytes, big) {
                    (8, true) => data.extend(part.to_be_bytes()),
                    (8, false) => data.extend(part.to_le_bytes()),
                    (_, true) => data.extend(f64::from(part).to_be_bytes()),
                    (_, false) => data.extend(f64::from(part).to_le_bytes()),
                }
            }
        }
        let descr = format!("{}c{bytes}", if big { '>' } else { '<' });
        let text = dictionary(&descr, fortran, "(3, 2, 5, 4)");
        let path = save(&folder, "F.npy", &npy_bytes(&text, &data));
        assert_holds_values(&*open_series(&path).unwrap(), shape);
    }
}

#[test]
fn what_npyz_writes_is_read() {
    use npyz::WriterBuilder;
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("F.npy");
    let file = fs::File::create(&path).unwrap();
    let options = npyz::WriteOptions::new().default_dtype().shape(&[2, 3, 4]).writer(file);
    let mut writer = options.begin_nd().unwrap();
    for i in 0..24 {
        let v = value(i / 12, 0, i / 4 % 3, i % 4);
        writer.push(&Complex64::new(f64::from(v.re), f64::from(v.im))).unwrap();
    }
    writer.finish().unwrap();
    let shape = Shape { frames: 2, depth: 1, height: 3, width: 4 };
    assert_holds_values(&*open_series(&path).unwrap(), shape);
}

#[test]
fn damaged_npy_files_are_refused() {
    let folder = TempDir::new().unwrap();
    let good = |shape: &str| dictionary("<c8", false, shape);
    let cases = [
        (Vec::new(), "empty"),
        (b"PK\x03\x04 this is a zip archive".to_vec(), "not an .npy file"),
        (b"\x93NUM".to_vec(), "not an .npy file"),
        (b"\x93NUMPY\x09\x00\x00\x00\x00\x00\x00\x00".to_vec(), "version 9"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff{".to_vec(), "claims 4294967295 bytes"),
        (b"\x93NUMPY\x01\x00\xff\xff{".to_vec(), "claims 65535 bytes"),
        (npy_bytes(&"(".repeat(60_000), &[]), "records"),
        (npy_bytes("{'descr': '<c8', 'shape': (1, 2, 3)}", &[]), "damaged"),
        (npy_bytes(&good("(1, 2"), &[]), "damaged"),
        (npy_bytes(&good("(1, -2, 3)"), &[]), "damaged"),
        (npy_bytes(&good("(99999999999999999999999, 1, 1)"), &[]), "damaged"),
        (npy_bytes(&good("(4294967296, 4294967296, 4294967296)"), &[]), "larger than any memory"),
        (npy_bytes(&good("(2, 3, 4)"), &[0; 191]), "needs 265 bytes, it has 264"),
        (npy_bytes(&good("(1000000, 1000, 1000)"), &[0; 8]), "cut short"),
        (npy_bytes(&good("(2, 3)"), &[0; 48]), "(time, y, x)"),
        (npy_bytes(&good("(0, 3, 4)"), &[]), "empty"),
        (npy_bytes(&dictionary("<f4", false, "(1, 1, 1)"), &[0; 4]), "float32; the complex field"),
        (npy_bytes(&dictionary("|O", false, "(1, 1, 1)"), &[0; 8]), "plain numbers"),
        (npy_bytes(&dictionary("é", false, "(1, 1, 1)"), &[0; 8]), "plain numbers"),
    ];
    for (bytes, expected) in cases {
        let path = save(&folder, "F.npy", &bytes);
        let text = message(open_series(&path), &path);
        assert!(text.contains(expected), "{text:?} does not say {expected:?}");
        assert!(npy::read_f64_1d(&path).is_err());
    }
}

#[test]
fn inputs_that_are_not_there_or_something_else() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("missing.npy");
    assert!(message(open_series(&path), &path).contains("no such file"));
    let path = folder.path().join("folder.npy");
    fs::create_dir(&path).unwrap();
    assert!(message(open_series(&path), &path).contains("is a folder"));
    let path = save(&folder, "F.tiff", b"II*");
    assert!(message(open_series(&path), &path).contains(".npy"));
    let path = save(&folder, "F.zarr", b"");
    assert!(message(open_series(&path), &path).contains("a Zarr store is a folder"));
}

#[test]
fn damaged_zarr_stores_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("V.zarr");
    fs::create_dir(&path).unwrap();
    assert!(message(open_series(&path), &path).contains("no zarr.json"));
    fs::write(path.join(".zgroup"), "{}").unwrap();
    assert!(message(open_series(&path), &path).contains("v2"));
    fs::write(path.join("zarr.json"), "{").unwrap();
    assert!(message(open_series(&path), &path).contains("damaged"));
    fs::write(path.join("zarr.json"), r#"{"zarr_format":3,"node_type":"group"}"#).unwrap();
    assert!(message(open_series(&path), &path).contains("no arrays"));

    let path = folder.path().join("C.zarr");
    let row = CurveRow { phase_rad: 1.0, sigma_rad: 0.1, ..CurveRow::missing(0, 0.0) };
    write_curve(&path, &[row, row], None, None, Attributes::new()).unwrap();
    assert!(message(open_series(&path), &path).contains("phase_rad, sigma_rad, time_s"));
}

#[test]
fn damaged_zarr_arrays_are_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("F.zarr");
    write_field(&path, 3, 7, 5).unwrap();
    let metadata = fs::read_to_string(path.join("field/zarr.json")).unwrap();
    let compact: serde_json::Value = serde_json::from_str(&metadata).unwrap();
    let broken = |key: &str, value: serde_json::Value| {
        let mut copy = compact.clone();
        copy[key] = value;
        fs::write(path.join("field/zarr.json"), copy.to_string()).unwrap();
        message(open_series(&path), &path)
    };
    let huge = 1_u64 << 40;
    assert!(broken("shape", json!([huge, huge, huge])).contains("larger than any memory"));
    assert!(broken("shape", json!([0, 7, 5])).contains("empty"));
    assert!(broken("shape", json!("many")).contains("damaged"));
    assert!(broken("codecs", json!([{"name": "unheard-of"}])).contains("cannot be read as Zarr"));
    let grid = json!({"name": "regular", "configuration": {"chunk_shape": [huge, 64, 64]}});
    assert!(broken("chunk_grid", grid).contains("cannot be read as Zarr"));

    fs::write(path.join("field/zarr.json"), &metadata).unwrap();
    let shard = path.join("field/c/0/0/0");
    let bytes = fs::read(&shard).unwrap();
    fs::write(&shard, &bytes[..bytes.len() / 2]).unwrap();
    let mut out = vec![Complex32::default(); 35];
    let series = open_series(&path).unwrap();
    assert!(
        message(series.read_rows(0, 0, 0..7, &mut out), &path.join("field")).contains("damaged")
    );

    cut_times(&path);
    assert!(message(open_series(&path), &path.join("time_s")).contains("2 times for 3 frames"));
}

/// Leave two of the acquisition times of a field.
fn cut_times(field: &Path) {
    let file = field.join("time_s/zarr.json");
    let text = fs::read_to_string(&file).unwrap();
    let mut metadata: serde_json::Value = serde_json::from_str(&text).unwrap();
    metadata["shape"] = json!([2]);
    fs::write(file, metadata.to_string()).unwrap();
}

#[test]
fn masks() {
    let folder = TempDir::new().unwrap();
    let mask = |descr: &str, fortran, shape: &str, data: &[u8]| {
        let path = save(&folder, "M.npy", &npy_bytes(&dictionary(descr, fortran, shape), data));
        (read_mask(&path, 2, 3), path)
    };
    let expected = [true, false, false, false, true, true];
    let (found, _) = mask("|b1", false, "(2, 3)", &[1, 0, 0, 0, 1, 1]);
    assert_eq!(found.unwrap(), expected);
    let (found, _) = mask("|u1", true, "(2, 3)", &[9, 0, 0, 255, 0, 1]);
    assert_eq!(found.unwrap(), expected);
    let wide: Vec<u8> = [256_i16, 0, 0, 0, -1, 1].iter().flat_map(|n| n.to_be_bytes()).collect();
    let (found, _) = mask(">i2", false, "(2, 3)", &wide);
    assert_eq!(found.unwrap(), expected);
    for (descr, shape, expected) in [
        ("|b1", "(3, 2)", "[3, 2]"),
        ("|b1", "(6,)", "[6]"),
        ("|b1", "(2, 3)", "no pixel"),
        ("<f4", "(2, 3)", "booleans or integers"),
    ] {
        let (found, path) = mask(descr, false, shape, &[0; 24]);
        assert!(message(found, &path).contains(expected));
    }
}

fn image_layout(sigma: bool) -> ImageLayout {
    let times_s = Some(vec![0.0, 0.25, 0.5]);
    ImageLayout {
        frames: 3,
        height: 10,
        width: 4,
        strip_rows: 4,
        sigma,
        attributes: Attributes::new(),
        times_s,
    }
}

/// The strips in an order of their own, from several threads.
fn write_images(writer: &ImageWriter, sigma: bool) {
    std::thread::scope(|scope| {
        for y0 in [8, 0, 4] {
            scope.spawn(move || {
                let rows = 4.min(10 - y0);
                let phase: Vec<f32> = (0..3 * rows * 4)
                    .map(|i| value(i / (rows * 4), 0, y0 + i / 4 % rows, i % 4).re)
                    .collect();
                let negative: Vec<f32> = phase.iter().map(|p| -p).collect();
                let valid = vec![true; rows * 4];
                writer.write_strip(y0, &phase, sigma.then_some(&negative), &valid).unwrap();
            });
        }
    });
}

#[test]
fn npy_images() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("P.npy");
    let writer = ImageWriter::create(&path, image_layout(true)).unwrap();
    write_images(&writer, true);
    assert!(!path.exists());
    assert_eq!(writer.finish().unwrap(), [path.clone(), folder.path().join("P.sigma.npy")]);
    let (shape, phase) = npy::read_real(&path).unwrap();
    let (_, sigma) = npy::read_real(&folder.path().join("P.sigma.npy")).unwrap();
    assert_eq!(shape, [3, 10, 4]);
    for (i, (phase, sigma)) in phase.iter().zip(sigma).enumerate() {
        assert_eq!(*phase, f64::from(value(i / 40, 0, i / 4 % 10, i % 4).re));
        assert_eq!(sigma, -phase);
    }
}

#[test]
fn zarr_images() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("P.zarr");
    for sigma in [true, false] {
        let writer = ImageWriter::create(&path, image_layout(sigma)).unwrap();
        write_images(&writer, sigma);
        assert_eq!(writer.finish().unwrap(), std::slice::from_ref(&path));
        assert_eq!(names(&folder), ["P.zarr"]);
        // The second result replaces the first entirely.
        assert_eq!(path.join("sigma_rad").exists(), sigma);
        assert!(read_mask(&path.join("valid"), 10, 4).unwrap().iter().all(|&valid| valid));
        let text = describe(&path).unwrap().to_string();
        assert!(text.contains("phase_rad: float32 (time 3, y 10, x 4)"), "{text}");
        assert!(text.contains("time_s: float64 (time 3), 0 to 0.5"), "{text}");
    }
}

#[test]
fn strips_that_do_not_fit_and_missing_strips() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("P.npy");
    let writer = ImageWriter::create(&path, image_layout(false)).unwrap();
    let phase = [0.0; 3 * 4 * 4];
    assert!(writer.write_strip(2, &phase, None, &[true; 16]).is_err());
    assert!(writer.write_strip(12, &phase, None, &[true; 16]).is_err());
    assert!(writer.write_strip(0, &phase, Some(&phase), &[true; 16]).is_err());
    assert!(writer.write_strip(0, &phase[1..], None, &[true; 16]).is_err());
    writer.write_strip(0, &phase, None, &[true; 16]).unwrap();
    assert!(writer.finish().unwrap_err().to_string().contains("4 of 10 rows"));
    assert!(names(&folder).is_empty());
}

#[test]
fn what_is_dropped_leaves_nothing_and_keeps_the_old() {
    let folder = TempDir::new().unwrap();
    for name in ["P.npy", "P.zarr"] {
        let path = folder.path().join(name);
        let writer = ImageWriter::create(&path, image_layout(true)).unwrap();
        write_images(&writer, true);
        assert!(names(&folder).iter().all(|n| n.starts_with(&format!(".{}", &name[..1]))));
        drop(writer);
        assert!(names(&folder).is_empty());
    }
    let path = folder.path().join("F.zarr");
    write_field(&path, 3, 7, 5).unwrap();
    drop(ImageWriter::create(&path, image_layout(true)).unwrap());
    assert!(open_series(&path).is_ok());
    let path = save(&folder, "old.npy", b"old");
    drop(NpyWriter::<f32>::create(&path, &[2]).unwrap());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(&folder), ["F.zarr", "old.npy"]);
}

#[test]
fn outputs_that_cannot_be_are_refused_at_once() {
    let folder = TempDir::new().unwrap();
    let create = |name: &str| {
        let path = folder.path().join(name);
        (ImageWriter::create(&path, image_layout(false)), path)
    };
    save(&folder, "file", b"");
    save(&folder, "file.zarr", b"");
    fs::create_dir(folder.path().join("mine.zarr")).unwrap();
    save(&folder, "mine.zarr/thesis.tex", b"");
    fs::create_dir(folder.path().join("folder.npy")).unwrap();
    for (name, expected) in [
        ("missing/P.npy", "does not exist"),
        ("missing/P.zarr", "does not exist"),
        ("file/P.npy", "not a folder"),
        ("file/P.zarr", "not a folder"),
        ("file.zarr", "is a file"),
        ("mine.zarr", "no zarr.json"),
        ("folder.npy", "not an ordinary file"),
        ("P.tiff", ".npy or .zarr"),
        ("P", ".npy or .zarr"),
        ("P.csv", "table"),
    ] {
        let (result, path) = create(name);
        let text = message(result, &path);
        assert!(text.contains(expected), "{text:?} does not say {expected:?}");
    }
    assert!(folder.path().join("mine.zarr/thesis.tex").exists());
    assert!(matches!(Format::of(Path::new("P.tiff")), Err(Error::Usage(_))));
    assert!(write_atomic(Path::new("/"), b"").is_err());
    assert!(write_atomic(Path::new("/dev/null"), b"").is_err());
}

#[test]
fn a_link_stays_a_link() {
    let folder = TempDir::new().unwrap();
    let target = save(&folder, "target.json", b"old");
    let link = folder.path().join("link.json");
    std::os::unix::fs::symlink(&target, &link).unwrap();
    write_atomic(&link, b"new").unwrap();
    assert!(link.is_symlink());
    assert_eq!(fs::read(&target).unwrap(), b"new");
}

#[test]
fn curves() {
    let folder = TempDir::new().unwrap();
    let rows = [
        CurveRow { phase_rad: 0.1 + 0.2, sigma_rad: 1e-300, ..CurveRow::missing(0, 0.0) },
        CurveRow { sigma_rad: f64::INFINITY, ..CurveRow::missing(1, 0.25) },
    ];
    let write =
        |name: &str| write_curve(&folder.path().join(name), &rows, None, None, Attributes::new());
    let written = write("C.csv").unwrap();
    let text = fs::read_to_string(&written[0]).unwrap();
    assert_eq!(
        text,
        "frame,time_s,phase_rad,sigma_rad\n0,0.0,0.30000000000000004,1e-300\n1,0.25,nan,inf\n"
    );
    let shown = describe(&written[0]).unwrap().to_string();
    assert!(shown.contains("phase_rad: text (row 2)"), "{shown}");
    let written = write("C.npy").unwrap();
    assert_eq!(npy::read_f64_1d(&written[0]).unwrap()[0], 0.1 + 0.2);
    assert_eq!(npy::read_f64_1d(&written[1]).unwrap()[1], f64::INFINITY);
    let written = write("C.zarr").unwrap();
    assert_eq!(zarr::read_coordinate(&written[0].join("time_s")).unwrap(), [0.0, 0.25]);
    assert!(write("C.png").is_err());
    assert!(write_curve(&folder.path().join("D.csv"), &[], None, None, Attributes::new()).is_err());
}

#[test]
fn descriptions() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("F.npy");
    write_field(&path, 4, 7, 5).unwrap();
    let description = describe(&path).unwrap();
    assert!(description.to_string().contains("complex64 (time 4, y 7, x 5)"));
    assert_eq!(description.bytes, fs::metadata(&path).unwrap().len());
    let path = folder.path().join("F.zarr");
    write_field(&path, 4, 7, 5).unwrap();
    let text = describe(&path).unwrap().to_string();
    assert!(text.contains("wavelength_nm = 841.0"), "{text}");
    let json = serde_json::to_value(describe(&path.join("field")).unwrap()).unwrap();
    assert_eq!(json["arrays"][0]["shape"], json!([4, 7, 5]));
}
