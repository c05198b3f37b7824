//! Pictures in a bag that are neither colour nor depth.

use super::*;
use std::sync::Arc;
use viola_formats::container::{Budget, Scratch};
use viola_formats::video::Tools;

#[test]
fn pictures_that_are_never_chosen_are_not_copied() {
    let recording = Recording::small(4);
    let (width, height) = recording.depth_size;
    let copied = |topics: &[(&'static str, &str)]| {
        let mut messages = messages(&recording, PosesBy::Odometry);
        let values = 100f32.to_le_bytes().repeat((width * height) as usize);
        for frame in &recording.frames {
            for (topic, encoding) in topics {
                let cdr =
                    Cdr::new().header(frame.time_s, "camera_depth_optical_frame").u32(height).u32(width);
                let cdr = cdr.text(encoding).put([0]).u32(4 * width).bytes(&values);
                messages.push((frame.time_s, *topic, IMAGE, cdr.0));
            }
        }
        let folder = folder_of(&messages);
        let budget = Arc::new(Budget::new(1 << 30));
        let scratch = Scratch::new(folder.path(), vec![budget.clone()]);
        let clip = Clip::open_in(&folder.path().join("bag.mcap"), &Tools::default(), &scratch).unwrap();
        assert_eq!(clip.frames().len(), 4, "{topics:?}");
        budget.used_bytes()
    };
    let wanted = copied(&[]);
    assert!(wanted > 0);
    assert_eq!(
        copied(&[("/camera/infra1/image_rect_raw", "mono8"), ("/camera/confidence", "32FC1")]),
        wanted
    );
    assert!(copied(&[("/other/image_raw", "mono8")]) > wanted);
}
