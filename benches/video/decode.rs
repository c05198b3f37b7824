//! Decodes all frames of a video and discards them; see `benches/video.sh`.

use std::fs::File;
use viola_formats::container::Region;
use viola_formats::video::{self, VideoError};

fn main() -> Result<(), VideoError> {
    let path = std::env::args_os().nth(1).expect("decode_video VIDEO");
    let region =
        Region::whole(File::open(path).map_err(VideoError::Unreadable)?).map_err(VideoError::Unreadable)?;
    let wanted: Vec<usize> = (0..video::inspect(&region)?.time_s.len()).collect();
    let frames = video::decode_planes(&region, &wanted)?;
    let count = frames.map(|frame| frame.map(drop)).collect::<Result<Vec<()>, _>>()?.len();
    println!("{count} frames");
    Ok(())
}
