use super::*;

/// A deterministic 8-bit texture; the expected values below are OpenCV 4.7's for the same texture.
fn texture(width: u32, height: u32) -> ColorImage {
    let value =
        |x: u32, y: u32, c: u32| ((x * 37 + y * 101 + c * 59 + (x * y * 7) % 61 + x * x * 3) % 256) as u8;
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [0, 1, 2].map(|c| value(x, y, c))));
    Grid::from_vec(Size::new(width, height), pixels.collect()).unwrap()
}

fn gray_texture(width: u32, height: u32) -> GrayImage {
    let pixels = texture(width, height).data().iter().map(|p| f32::from(p[0]) / 255.0).collect();
    Grid::from_vec(Size::new(width, height), pixels).unwrap()
}

fn assert_color(width: u32, height: u32, factor: f64, expected: &[u8]) {
    let small = area_color(&texture(width, height), factor);
    assert_eq!(small.data().as_flattened(), expected, "{width}x{height} by {factor}");
}

#[test]
fn halving_rounds_half_up_and_averages_the_cut_edge() {
    let expected = [
        72, 131, 126, 107, 102, 97, 102, 161, 92, 121, 116, 111, 149, 144, 139, 85, 144, 75, 89, 84, 143,
        137, 196, 127, 130, 61, 120, 131, 126, 185, 107, 102, 161, 177, 108, 167, 170, 101, 96, 88, 147, 142,
        142, 137, 68, 76, 135, 130, 114, 109, 104, 141, 200, 131, 135, 194, 125, 220, 22, 82, 102, 162, 220,
        107, 166, 97, 136, 194, 126, 50, 109, 168,
    ];
    assert_color(11, 7, 0.5, &expected);
}

#[test]
fn whole_factors_average_blocks() {
    assert_color(10, 9, 0.25, &[101, 128, 123, 121, 116, 127, 133, 128, 123, 114, 141, 120]);
    let expected = [
        93, 95, 126, 121, 123, 97, 139, 113, 144, 99, 130, 132, 126, 128, 130, 121, 151, 96, 99, 130, 132,
        131, 133, 136, 123, 154, 128, 135, 109, 139, 122, 124, 126, 121, 123, 154,
    ];
    assert_color(13, 9, 1.0 / 3.0, &expected);
}

#[test]
fn other_factors_weigh_the_pixels_that_a_cell_covers() {
    let expected = [
        58, 117, 135, 113, 110, 118, 121, 180, 85, 88, 106, 103, 129, 137, 104, 140, 138, 135, 79, 138, 105,
        130, 113, 172, 111, 78, 116, 100, 128, 136, 126, 93, 132, 143, 90, 118, 134, 122, 181, 110, 108, 136,
        147, 114, 173, 150, 133, 153, 134, 131, 98, 110, 138, 115, 95, 154, 80, 107, 166, 133, 110, 107, 136,
        158, 125, 122, 139, 136, 134, 96, 154, 98, 157, 124, 142, 143, 120, 127, 173, 99, 97, 99, 158, 176,
        95, 154, 100, 82, 141, 139, 107, 166, 133, 150, 133, 76, 128, 187, 105, 98, 106, 152, 133, 166, 110,
        145, 89, 122, 116, 136, 182, 102, 85, 105, 140, 122, 181, 144, 107, 166,
    ];
    assert_color(13, 8, 0.6, &expected);
    let expected = [
        81, 117, 124, 110, 123, 107, 114, 121, 99, 140, 126, 133, 107, 102, 127, 120, 161, 118, 116, 112,
        135, 140, 111, 149, 152, 123, 119, 142, 116, 111, 114, 144, 135, 85, 144, 114,
    ];
    assert_color(9, 7, 0.45, &expected);
}

#[test]
fn grey_images_resize_like_opencv() {
    /// Last bits differ with the order of additions that a processor's vector width implies.
    const ROUNDING: f32 = 3e-7;
    let cases: [(u32, u32, f64, &[f32]); 4] = [
        (6, 5, 0.5, &[0.28333336, 0.42058825, 0.4009804, 0.35, 0.5372549, 0.50784314]),
        (9, 8, 0.25, &[0.39779413, 0.4742647, 0.52132356, 0.44803923]),
        (
            7,
            5,
            0.6,
            &[
                0.22556862, 0.44203925, 0.47403926, 0.3432157, 0.43513727, 0.39105886, 0.49521574, 0.5618824,
                0.5242353, 0.43184316, 0.3728628, 0.4191373,
            ],
        ),
        (
            4,
            3,
            1.4,
            &[
                -0.04335587,
                0.039869495,
                0.17518395,
                0.301755,
                0.5162509,
                0.6120119,
                0.16655493,
                0.32762954,
                0.56522477,
                0.65693706,
                0.31877857,
                0.13666707,
                0.54942197,
                0.48019552,
                0.5499672,
                0.69164807,
                0.2542089,
                0.020740747,
                0.8545132,
                0.30787167,
                -0.03584291,
                0.23529412,
                0.43611732,
                0.5212828,
            ],
        ),
    ];
    for (width, height, factor, expected) in cases {
        let resized = resize_gray(&gray_texture(width, height), factor);
        assert_eq!(resized.data().len(), expected.len());
        for (got, want) in resized.data().iter().zip(expected) {
            assert!((got - want).abs() <= ROUNDING, "{width}x{height} by {factor}: {got} is not {want}");
        }
    }
}

#[test]
fn rounding_to_bytes_is_half_to_even_and_clamps() {
    let cases = [(0.5, 0), (1.5, 2), (2.5, 2), (254.5, 254), (254.51, 255), (300.0, 255), (-0.6, 0)];
    for (value, byte) in cases {
        assert_eq!(u8::from_f32(value), byte, "{value}");
    }
}

#[test]
fn luma_weighs_the_channels() {
    let image =
        Grid::from_vec(Size::new(4, 1), vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3]]).unwrap();
    let gray = gray_from_color(&image);
    for (got, want) in gray.data().iter().zip([0.299, 0.587, 0.114, 1.0]) {
        assert!((got - want).abs() < 1e-6, "{got} is not {want}");
    }
}

#[test]
fn nearest_takes_the_pixel_that_holds_the_scaled_corner() {
    let row = Grid::from_vec(Size::new(5, 1), vec![10u16, 20, 30, 40, 50]).unwrap();
    assert_eq!(resize_nearest(&row, Size::new(2, 1)).data(), &[10, 30]);
    assert_eq!(resize_nearest(&row, Size::new(3, 2)).data(), &[10, 20, 40, 10, 20, 40]);
    assert_eq!(resize_nearest(&row, Size::new(10, 1)).data(), &[10, 10, 20, 20, 30, 30, 40, 40, 50, 50]);
    assert_eq!(resize_nearest(&Grid::<u16>::default(), Size::new(2, 1)).data(), &[0, 0]);
}

#[test]
fn flat_images_stay_flat_at_any_factor() {
    let flat = Grid::filled(Size::new(97, 61), [201u8, 3, 255]);
    for factor in [0.999, 0.81, 0.5, 0.37, 0.25, 0.02, 0.004] {
        let small = area_color(&flat, factor);
        assert_eq!(small.size(), scaled_size(flat.size(), factor));
        assert!(small.data().iter().all(|&p| p == [201, 3, 255]), "factor {factor}");
    }
}
