use super::*;
use image::Rgb;
use viola_network::manifest::Manifest;

fn rule(fields: &str) -> Input {
    let text = format!(
        "[[network]]\nname = \"n\"\ntask = \"depth\"\nfile = \"f\"\nlicence = \"l\"\noutput = {{ kind = \"depth\" }}\n\
         input = {{ width = \"any\", height = \"any\", {fields} }}\nsource = {{ kind = \"export\", how = \"h\" }}\n"
    );
    Manifest::parse(&text).unwrap().networks.remove(0).input.unwrap()
}

fn raster(width: usize, height: usize) -> Raster {
    Raster { width, height }
}

fn stripes(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        Rgb([0, 1, 2].map(|c| ((x * (3 + 2 * c) + y * (7 - 2 * c) + x * y / 64) % 256) as u8))
    })
}

/// Values of torch 2.15, `interpolate(mode="bilinear", antialias=True, align_corners=False)`.
#[test]
fn resizes_as_torch_does() {
    type Places = [(usize, usize, [f32; 3]); 3];
    let table: [(Raster, Raster, Places); 4] = [
        (
            raster(80, 60),
            raster(33, 25),
            [
                (0, 0, [9.262, 9.304, 9.346]),
                (32, 24, [198.886, 238.844, 22.939]),
                (16, 8, [24.401, 52.757, 91.961]),
            ],
        ),
        (
            raster(80, 60),
            raster(160, 120),
            [(0, 0, [0.0, 0.0, 0.0]), (159, 119, [210.0, 250.0, 34.0]), (40, 118, [232.25, 154.25, 76.25])],
        ),
        (
            raster(80, 60),
            raster(80, 60),
            [(0, 0, [0.0, 0.0, 0.0]), (79, 59, [210.0, 250.0, 34.0]), (20, 58, [228.0, 152.0, 76.0])],
        ),
        (
            raster(7, 90),
            raster(3, 11),
            [
                (0, 0, [33.169, 26.141, 19.113]),
                (2, 10, [102.113, 199.141, 40.169]),
                (1, 3, [204.225, 156.559, 106.266]),
            ],
        ),
    ];
    for (from, to, places) in table {
        let picture = stripes(from.width as u32, from.height as u32);
        let fit = Fit { input: to, content: to };
        let (mean, std) = ([0.5f32, 0.25, 0.1], [0.5f32, 2.0, 0.3]);
        let normal = "mean = [0.5, 0.25, 0.1], std = [0.5, 2.0, 0.3]";
        let planes = tensor(&picture, fit, &rule(normal), false);
        let pixels =
            tensor(&picture, fit, &rule(&format!("{normal}, layout = \"nhwc\", channels = \"bgr\"")), false);
        assert_eq!(planes.shape, [1, 3, to.height, to.width]);
        assert_eq!(pixels.shape, [1, to.height, to.width, 3]);
        for (x, y, wanted) in places {
            for c in 0..3 {
                let wanted = (wanted[c] / 255.0 - mean[c]) / std[c];
                let got = planes.as_f32().unwrap()[(c * to.height + y) * to.width + x];
                assert!((got - wanted).abs() < 2e-4, "{from:?} {to:?} {x} {y} {c}: {got} {wanted}");
                assert_eq!(got, pixels.as_f32().unwrap()[(y * to.width + x) * 3 + 2 - c]);
            }
        }
    }
}

/// With aligned corners, the corner pixels are the picture's own.
#[test]
fn aligned_corners_stay() {
    let fit = Fit { input: raster(17, 9), content: raster(11, 9) };
    let values = tensor(&stripes(6, 5), fit, &rule(""), true);
    let at = |x: usize, y: usize| values.as_f32().unwrap()[y * 17 + x] * 255.0;
    for (x, y, wanted) in
        [(0, 0, 0.0), (10, 0, 15.0), (0, 8, 28.0), (10, 8, 43.0), (11, 0, 0.0), (16, 8, 0.0)]
    {
        assert!((at(x, y) - wanted).abs() < 1e-3, "{x} {y}: {}", at(x, y));
    }
}

#[test]
fn padding_ends_on_a_cell_of_the_output() {
    for (picture, input, output, align_corners, content, crop) in [
        // A 4:3 picture fills DeepLab's input, although the ratios differ slightly.
        (raster(640, 480), raster(513, 385), raster(129, 97), true, raster(513, 385), raster(129, 97)),
        (raster(648, 484), raster(513, 385), raster(129, 97), true, raster(513, 385), raster(129, 97)),
        (raster(480, 640), raster(513, 385), raster(129, 97), true, raster(289, 385), raster(73, 97)),
        (raster(1920, 1080), raster(513, 385), raster(129, 97), true, raster(513, 289), raster(129, 73)),
        (raster(640, 480), raster(513, 513), raster(129, 129), true, raster(513, 385), raster(129, 97)),
        (raster(640, 480), raster(512, 512), raster(128, 128), false, raster(512, 384), raster(128, 96)),
        (raster(1, 9000), raster(512, 512), raster(128, 128), false, raster(4, 512), raster(1, 128)),
        (raster(5, 5), raster(1, 1), raster(1, 1), true, raster(1, 1), raster(1, 1)),
    ] {
        let fit = Fit::into_fixed(picture, input, Some(output), align_corners);
        assert_eq!(fit, Fit { input, content }, "{picture:?}");
        assert_eq!(fit.crop(output, align_corners), crop, "{picture:?}");
    }
}

#[test]
fn open_sizes_follow_the_rule() {
    let rule = rule("shortest = 384, longest = 640, multiple = 32");
    for (picture, content, input) in [
        (raster(640, 480), raster(512, 384), raster(512, 384)),
        (raster(480, 640), raster(384, 512), raster(384, 512)),
        (raster(1920, 1080), raster(640, 360), raster(640, 384)),
        (raster(100, 100), raster(384, 384), raster(384, 384)),
        (raster(60_000, 1), raster(640, 1), raster(640, 32)),
    ] {
        assert_eq!(Fit::by_rule(picture, &rule), Fit { input, content }, "{picture:?}");
    }
}

#[test]
fn numbers_are_resized_like_pictures() {
    let values: Vec<f32> = (0..6).map(|n| 0.1 + n as f32).collect();
    assert_eq!(resized(&values, raster(3, 2), raster(3, 2)), values);
    assert_eq!(resized(&[0.0, 4.0], raster(2, 1), raster(4, 1)), [0.0, 1.0, 3.0, 4.0]);
    assert_eq!(resized(&[0.0, 4.0], raster(1, 2), raster(1, 4)), [0.0, 1.0, 3.0, 4.0]);
    assert_eq!(resized(&[7.0], raster(1, 1), raster(2, 2)), [7.0; 4]);
}
