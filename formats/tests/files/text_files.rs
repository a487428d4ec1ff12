//! Region-of-interest and view-neighbour text files of the corpus.

use crate::common::{damage, fixture};
use semvs_formats::{neighbors_file, roi};

#[test]
fn the_region_of_interest_is_read() {
    let text = fixture("format-corpus/other/roi_in.txt");
    let obb = roi::parse(&text).unwrap();
    assert_eq!(obb.rotation, [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!((obb.center, obb.half_extent), ([10.0, 0.0, 0.0], [1.0, 2.0, 3.0]));
    damage(&text, |text| roi::parse(text).map(drop));
}

#[test]
fn the_neighbours_are_read() {
    let text = fixture("format-corpus/other/nb.txt");
    let file = neighbors_file::parse(&text, 3).unwrap();
    let lists: Vec<_> = file.lists.iter().map(|l| (l.image, l.neighbors.as_slice())).collect();
    assert_eq!(lists, [(0, &[1, 2][..]), (2, &[0, 1])]);
    assert_eq!(file.alone, []);
    damage(&text, |text| neighbors_file::parse(text, 3).map(drop));
}
