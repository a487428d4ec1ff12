//! What can be dropped or set right without losing a scene.

use std::collections::HashSet;

use super::scene::{NO_ID, Scene, Visibility};
use crate::Result;

/// How much [`Scene::repair`] changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Views dropped because their image does not exist or is not calibrated.
    pub dropped_views: u64,
    /// Views merged with another one of the same image.
    pub merged_views: u64,
    /// Lists of views that were not sorted by image.
    pub sorted_lists: u64,
    /// Weights that were negative or not finite, now 0.
    pub zeroed_weights: u64,
    /// Points dropped because their position or normal is not finite.
    pub dropped_points: u64,
    /// Neighbour entries dropped because their image does not exist or is the image itself, or a number is not
    /// finite.
    pub dropped_view_scores: u64,
    /// Global IDs that several images share; then every image has its local index as ID.
    pub shared_ids: u64,
}

impl Scene {
    /// Sets right what a program can do without: views of images that are not there, repeated and unsorted views
    /// (of repeated ones the larger weight is kept), weights and points that are not finite, neighbour entries that
    /// lead nowhere, global IDs that are not unique. Lines are left alone but for their views.
    ///
    /// A scene as OpenMVS writes it does not change.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if the lengths of attributes disagree, which no reader of this crate returns.
    pub fn repair(&mut self) -> Result<Repairs> {
        self.check_lengths()?;
        let mut done = Repairs::default();
        let usable: Vec<bool> = self.images.iter().map(|i| i.pose != NO_ID).collect();
        self.repair_points(&usable, &mut done);
        for line in &mut self.lines {
            let before = line.views.len();
            line.views.retain(|&(image, _)| usable.get(image as usize) == Some(&true));
            done.dropped_views += (before - line.views.len()) as u64;
        }
        let images = self.images.len();
        for (i, image) in self.images.iter_mut().enumerate() {
            let before = image.view_scores.len();
            image.view_scores.retain(|s| {
                let finite = [s.scale, s.angle, s.area, s.score].iter().all(|v| v.is_finite());
                finite && (s.image as usize) < images && s.image as usize != i
            });
            done.dropped_view_scores += (before - image.view_scores.len()) as u64;
        }
        let mut seen = HashSet::new();
        let ids = self.images.iter().enumerate().map(|(i, image)| image.id_at(i));
        done.shared_ids = ids.filter(|&id| !seen.insert(id)).count() as u64;
        if done.shared_ids > 0 {
            self.images.iter_mut().for_each(|image| image.id = NO_ID);
        }
        Ok(done)
    }

    /// Rebuilds the points and their views in place.
    fn repair_points(&mut self, usable: &[bool], done: &mut Repairs) {
        let cloud = &mut self.points;
        let count = cloud.positions.len();
        let has_views = !cloud.views.is_empty();
        let mut list = Vec::new();
        let (mut kept, mut start, mut end) = (0, 0, 0);
        for i in 0..count {
            let finite = cloud.positions[i].iter().chain(cloud.normals.get(i).into_iter().flatten());
            let finite = finite.into_iter().all(|v| v.is_finite());
            if has_views {
                let range = start..cloud.views.offsets[i + 1] as usize;
                start = range.end;
                take_list(&cloud.views, range, usable, &mut list, done);
            }
            if !finite {
                done.dropped_points += 1;
                continue;
            }
            cloud.positions[kept] = cloud.positions[i];
            if !cloud.normals.is_empty() {
                cloud.normals[kept] = cloud.normals[i];
            }
            if !cloud.colors.is_empty() {
                cloud.colors[kept] = cloud.colors[i];
            }
            kept += 1;
            if has_views {
                put_list(&mut cloud.views, &mut end, &list);
                cloud.views.offsets[kept] = end as u64;
            }
        }
        cloud.positions.truncate(kept);
        cloud.normals.truncate(kept);
        cloud.colors.truncate(kept);
        if has_views {
            cloud.views.offsets.truncate(kept + 1);
            cloud.views.images.truncate(end);
            cloud.views.weights.truncate(end);
        }
    }
}

/// Takes one list out of `views`, in order, without what cannot be used.
fn take_list(
    views: &Visibility,
    range: std::ops::Range<usize>,
    usable: &[bool],
    list: &mut Vec<(u32, f32)>,
    done: &mut Repairs,
) {
    list.clear();
    for k in range {
        let image = views.images[k];
        if usable.get(image as usize) != Some(&true) {
            done.dropped_views += 1;
            continue;
        }
        let weight = views.weights.get(k).copied().unwrap_or(0.0);
        let sound = weight >= 0.0 && weight.is_finite();
        done.zeroed_weights += u64::from(!sound);
        list.push((image, if sound { weight } else { 0.0 }));
    }
    if !list.is_sorted_by_key(|view| view.0) {
        done.sorted_lists += 1;
        list.sort_by_key(|view| view.0);
    }
    let before = list.len();
    list.dedup_by(|next, first| {
        let same = next.0 == first.0;
        if same {
            first.1 = first.1.max(next.1);
        }
        same
    });
    done.merged_views += (before - list.len()) as u64;
}

/// Puts a list at `end`, which never overtakes the lists that were not yet taken out.
fn put_list(views: &mut Visibility, end: &mut usize, list: &[(u32, f32)]) {
    for &(image, weight) in list {
        views.images[*end] = image;
        if let Some(slot) = views.weights.get_mut(*end) {
            *slot = weight;
        }
        *end += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{Image, PointCloud, ViewScore};
    use super::*;

    /// Three calibrated images and an uncalibrated one.
    fn scene(lists: &[(&[u32], &[f32])]) -> Scene {
        let mut views = Visibility::default();
        lists.iter().for_each(|(images, weights)| views.push(images, weights));
        let positions = (0..lists.len()).map(|i| [i as f32; 3]).collect();
        let image = |pose| Image { pose, platform: 0, camera: 0, ..Image::default() };
        Scene {
            images: [0, 1, 2, NO_ID].map(image).to_vec(),
            points: PointCloud { positions, views, ..PointCloud::default() },
            ..Scene::default()
        }
    }

    #[test]
    fn a_sound_scene_does_not_change() {
        let mut s = scene(&[(&[0, 1], &[0.5, 1.0]), (&[1, 2], &[0.0, 2.0]), (&[], &[])]);
        let before = s.clone();
        assert_eq!(s.repair().unwrap(), Repairs::default());
        assert_eq!(s, before);
    }

    #[test]
    fn views_are_sorted_merged_and_dropped_with_their_weights() {
        let mut s = scene(&[
            (&[2, 0, 1], &[2.0, 0.0, 1.0]),
            (&[0, 3, 9, 1], &[1.0, 5.0, 5.0, f32::NAN]),
            (&[1, 0, 1], &[0.25, -1.0, 0.5]),
        ]);
        let done = s.repair().unwrap();
        let views = &s.points.views;
        assert_eq!((views.images_of(0), views.weights_of(0)), (&[0, 1, 2][..], &[0.0, 1.0, 2.0][..]));
        assert_eq!((views.images_of(1), views.weights_of(1)), (&[0, 1][..], &[1.0, 0.0][..]));
        assert_eq!((views.images_of(2), views.weights_of(2)), (&[0, 1][..], &[0.0, 0.5][..]));
        let expected =
            Repairs { dropped_views: 2, merged_views: 1, sorted_lists: 2, zeroed_weights: 2, ..done };
        assert_eq!((done, done.dropped_points), (expected, 0));
        s.check_lengths().unwrap();
    }

    #[test]
    fn points_that_are_nowhere_go_with_all_they_have() {
        let mut s = scene(&[(&[0, 1], &[]), (&[1], &[]), (&[1, 2], &[])]);
        s.points.positions[0][1] = f32::NAN;
        s.points.colors = vec![[0; 3], [1; 3], [2; 3]];
        s.points.normals = vec![[0.0; 3], [f32::INFINITY; 3], [0.0, 0.0, 1.0]];
        assert_eq!(s.repair().unwrap().dropped_points, 2);
        assert_eq!((s.points.positions, s.points.colors), (vec![[2.0; 3]], vec![[2; 3]]));
        assert_eq!((s.points.views.images_of(0), s.points.views.len()), (&[1, 2][..], 1));
    }

    #[test]
    fn neighbours_that_lead_nowhere_are_dropped() {
        let mut s = scene(&[]);
        let entry = |image, scale| ViewScore { image, scale, ..ViewScore::default() };
        s.images[1].view_scores = vec![entry(0, 1.0), entry(1, 1.0), entry(4, 1.0), entry(2, f32::NAN)];
        assert_eq!(s.repair().unwrap().dropped_view_scores, 3);
        assert_eq!(s.images[1].view_scores, [entry(0, 1.0)]);
    }

    #[test]
    fn shared_ids_give_way_to_local_indices() {
        let mut s = scene(&[]);
        s.images[0].id = 2; // which image 2 has by its position
        assert_eq!(s.repair().unwrap().shared_ids, 1);
        assert!(s.images.iter().enumerate().all(|(i, image)| image.id_at(i) == i as u32));
    }
}
