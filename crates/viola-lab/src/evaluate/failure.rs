//! Picture of a failed clip: the answer on the left, the truth on the right. Without a true pose, the answer alone.

use super::Sample;
use viola_align::{Aligned, Alignment};
use viola_home as home;
use viola_reconstruct::PointCloud;

pub(super) fn picture(sample: &Sample, answer: Alignment) -> Vec<u8> {
    let mut truth = answer.clone();
    truth.map_from_clip = sample.map_from_clip;
    truth.alternatives.clear();
    let [answer, truth] = [answer, truth].map(|alignment| {
        let scan = sample.observation.scan.clone();
        // Only the scan is drawn.
        let aligned = Aligned {
            alignment,
            cloud_in_clip: PointCloud::default(),
            scan,
            views: Vec::new(),
            features: Vec::new(),
            completion: None,
        };
        home::overlay_png(&sample.lidar, &aligned)
    });
    let both = sample.map_from_clip.and_then(|_| beside(&answer, &truth));
    both.unwrap_or(answer)
}

fn beside(left: &[u8], right: &[u8]) -> Option<Vec<u8>> {
    const GAP_PX: u32 = 16;
    let [left, right] = [left, right].map(|png| image::load_from_memory(png).ok().map(|p| p.to_rgb8()));
    let (left, right) = (left?, right?);
    let width = left.width() + GAP_PX + right.width();
    let mut both =
        image::RgbImage::from_pixel(width, left.height().max(right.height()), image::Rgb([120; 3]));
    image::imageops::replace(&mut both, &left, 0, 0);
    image::imageops::replace(&mut both, &right, i64::from(left.width() + GAP_PX), 0);
    let mut png = std::io::Cursor::new(Vec::new());
    both.write_to(&mut png, image::ImageFormat::Png).ok()?;
    Some(png.into_inner())
}
