//! Clips as zip files in the layout of ScanNet's exporter.

use super::clip::SimulatedClip;
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};
use rayon::prelude::*;
use std::io::{Seek, Write};
use viola_formats::clip::Frame;
use viola_geometry::{Pinhole, Pose3};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// Frames rendered and encoded at a time; the archive is written in order.
const BATCH: usize = 8;

/// Error of writing an archive.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error("cannot encode a picture: {0}")]
    Picture(#[from] image::ImageError),
    #[error("cannot write the archive: {0}")]
    Archive(#[from] zip::result::ZipError),
    #[error("cannot write the archive: {0}")]
    Write(#[from] std::io::Error),
    #[error("cannot write truth.json: {0}")]
    Truth(#[from] serde_json::Error),
}

/// The pictures of one frame as files.
struct Encoded {
    color: Vec<u8>,
    depth: Vec<u8>,
    pose: String,
    classes: Vec<u8>,
    instances: Vec<u8>,
}

/// Writes `color/N.jpg`, `depth/N.png` (16 bit, millimetres), `pose/N.txt` (camera to world, OpenCV axes,
/// z up), `intrinsic/*.txt`, `labels/N.png` and `instances/N.png` (16 bit) and `truth.json`.
pub fn write_scannet_zip(clip: &SimulatedClip, to: impl Write + Seek) -> Result<(), ExportError> {
    let mut zip = ZipWriter::new(to);
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let packed = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    let identity = matrix_text(&nalgebra::Matrix4::identity());
    for (name, text) in [
        ("intrinsic/intrinsic_color.txt", intrinsic_text(&clip.color_camera)),
        ("intrinsic/intrinsic_depth.txt", intrinsic_text(&clip.depth_camera)),
        ("intrinsic/extrinsic_color.txt", identity.clone()),
        ("intrinsic/extrinsic_depth.txt", identity),
        ("truth.json", serde_json::to_string_pretty(&clip.truth)?),
    ] {
        zip.start_file(name, packed)?;
        zip.write_all(text.as_bytes())?;
    }
    let indices: Vec<usize> = (0..clip.headers().len()).collect();
    for batch in indices.chunks(BATCH) {
        let encoded: Vec<Result<Encoded, ExportError>> =
            batch.par_iter().map(|&index| encode(clip, index)).collect();
        for (index, files) in batch.iter().zip(encoded) {
            let files = files?;
            for (name, bytes) in [
                (format!("color/{index}.jpg"), files.color),
                (format!("depth/{index}.png"), files.depth),
                (format!("labels/{index}.png"), files.classes),
                (format!("instances/{index}.png"), files.instances),
            ] {
                zip.start_file(name, stored)?;
                zip.write_all(&bytes)?;
            }
            zip.start_file(format!("pose/{index}.txt"), packed)?;
            zip.write_all(files.pose.as_bytes())?;
        }
    }
    zip.finish()?.flush()?;
    Ok(())
}

fn encode(clip: &SimulatedClip, index: usize) -> Result<Encoded, ExportError> {
    let Frame { header, color, depth, .. } = clip.frame(index);
    let labels = clip.labels(index);
    let mut jpeg = vec![];
    if let Some(color) = &color {
        JpegEncoder::new_with_quality(&mut jpeg, 85).encode_image(color)?;
    }
    let millimetres: Vec<u16> = depth.depth_m.iter().map(|d| (d * 1000.0).round() as u16).collect();
    let world_from_camera: Pose3 = header.world_from_camera.unwrap_or_else(Pose3::identity);
    Ok(Encoded {
        color: jpeg,
        depth: grey_png(depth.width, depth.height, &millimetres)?,
        pose: matrix_text(&world_from_camera.to_homogeneous()),
        classes: grey_png(labels.width, labels.height, &labels.classes)?,
        instances: grey_png(labels.width, labels.height, &labels.instances)?,
    })
}

fn grey_png(width: u32, height: u32, values: &[u16]) -> Result<Vec<u8>, ExportError> {
    let mut png = vec![];
    // The encoder takes 16-bit samples in the machine's byte order.
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    PngEncoder::new(&mut png).write_image(&bytes, width, height, ExtendedColorType::L16)?;
    Ok(png)
}

fn intrinsic_text(camera: &Pinhole) -> String {
    let mut matrix = nalgebra::Matrix4::identity();
    matrix[(0, 0)] = camera.fx;
    matrix[(1, 1)] = camera.fy;
    matrix[(0, 2)] = camera.cx;
    matrix[(1, 2)] = camera.cy;
    matrix_text(&matrix)
}

fn matrix_text(matrix: &nalgebra::Matrix4<f64>) -> String {
    let row = |r: usize| {
        let values: Vec<String> = (0..4).map(|c| format!("{:.6}", matrix[(r, c)])).collect();
        values.join(" ") + "\n"
    };
    (0..4).map(row).collect()
}
