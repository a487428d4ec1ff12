//! What to do with each class.

use super::{ClassId, ClassTable, PlanePrior};
use crate::Result;

/// How labels restrict which pixels become one point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Consistency {
    /// Not at all; the point's label is voted.
    Off,
    /// A pixel of another class does not support the point and stays free to form its own.
    #[default]
    Support,
    /// As `Support`, and one pixel of another class rejects the point.
    Strict,
}

impl Consistency {
    /// As the command line spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Consistency::Off => "off",
            Consistency::Support => "support",
            Consistency::Strict => "strict",
        }
    }
}

/// Which pixels have a vote on the label of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Voters {
    /// Those of all views that see the surface, before anything is fused: the check reads the labels voted for.
    #[default]
    All,
    /// Those that are merged into the point.
    Merged,
}

impl Voters {
    /// As the command line spells it.
    pub const fn name(self) -> &'static str {
        match self {
            Voters::All => "all",
            Voters::Merged => "merged",
        }
    }
}

/// What labels decide while depths are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LabelEstimation {
    /// Nothing: every pixel is estimated.
    Off,
    /// Pixels of classes that are not wanted are not estimated.
    #[default]
    Skip,
    /// That, and hypotheses do not spread across class borders; a source view that shows another class at a hypothesis costs
    /// `cost` more, 0..=2.
    Aware {
        /// The penalty, on the 0 (best) .. 2 (worst) scale.
        cost: f32,
    },
}

impl LabelEstimation {
    /// Penalty of [`LabelEstimation::Aware`] unless another is given.
    pub const DEFAULT_COST: f32 = 0.2;

    /// As the command line spells it.
    pub const fn name(self) -> &'static str {
        match self {
            LabelEstimation::Off => "off",
            LabelEstimation::Skip => "skip",
            LabelEstimation::Aware { .. } => "aware",
        }
    }
}

/// Which classes are wanted and how strictly labels are compared, as the user asked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClassRules {
    /// Names or ids of the only classes to keep (void only if named); empty = all that the table keeps.
    pub classes: Vec<String>,
    /// Names or ids of classes to drop.
    pub exclude: Vec<String>,
    /// What labels decide in estimation. Default: [`LabelEstimation::Skip`].
    pub estimation: LabelEstimation,
    /// How labels restrict fusion. Default: [`Consistency::Support`].
    pub consistency: Consistency,
    /// Width in depth-map pixels of the band along class borders that counts as void in the check. Default: 0.
    pub border: u32,
    /// Which pixels have a vote on the label of a point. Default: all.
    pub voters: Voters,
    /// Points around a point that vote on its label once more, after fusion; 0 = none. Default: 0.
    pub smooth: u32,
    /// Whether the filter across views lets a neighbour's pixel of another class neither confirm nor refute a depth.
    /// Default: false.
    pub filter: bool,
}

/// Whether two labels may meet in one point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Agreement {
    /// Equal, or at least one is void, or labels are not compared.
    Agrees,
    /// Two different classes.
    Differs,
}

/// What to do with each class: one cheap answer per pixel.
///
/// The default keeps everything and compares nothing, as if there were no labels.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassPolicy {
    kept: Vec<bool>,
    estimated: Vec<bool>,
    /// Classes without a surface, where labels are compared.
    without_surface: Vec<ClassId>,
    /// Classes whose pixels are drawn towards planes.
    planar: Vec<(ClassId, PlanePrior)>,
    others_kept: bool,
    others_estimated: bool,
    consistency: Consistency,
    border: u32,
}

impl Default for ClassPolicy {
    fn default() -> Self {
        ClassPolicy {
            kept: Vec::new(),
            estimated: Vec::new(),
            without_surface: Vec::new(),
            planar: Vec::new(),
            others_kept: true,
            others_estimated: true,
            consistency: Consistency::Off,
            border: 0,
        }
    }
}

impl ClassPolicy {
    /// The policy that `rules` mean for the classes of `table`.
    ///
    /// `classes` overrides the table's `keep`; `exclude` drops in either case. Void is kept unless `classes` leaves it
    /// out or `exclude` names it. Classes without a surface make no points unless `classes` names them or labels are
    /// not compared.
    ///
    /// # Errors
    /// A rule names a class that the table lacks, or nothing would be kept.
    pub fn new(table: &ClassTable, rules: &ClassRules) -> Result<Self> {
        let resolve =
            |names: &[String]| -> Result<Vec<ClassId>> { names.iter().map(|n| table.resolve(n)).collect() };
        let wanted = resolve(&rules.classes)?;
        let unwanted = resolve(&rules.exclude)?;
        let last = table.classes().iter().map(|class| class.id).chain(wanted.iter().copied());
        let last = last.chain(unwanted.iter().copied()).max().unwrap_or_default();
        let others_kept = wanted.is_empty();
        let keeps = |id: ClassId| {
            let named = if others_kept { table.get(id).is_none_or(|c| c.keep) } else { wanted.contains(&id) };
            named && !unwanted.contains(&id)
        };
        let ids = || (0..=last.0).map(ClassId);
        let kept: Vec<bool> = ids().map(keeps).collect();
        let all = rules.estimation == LabelEstimation::Off;
        let wants = |id| table.get(id).and_then(|c| c.estimate).unwrap_or(kept[usize::from(id.0)]);
        let estimated = ids().map(|id| all || wants(id)).collect();
        let listed = ids().any(|id| table.contains(id) && kept[usize::from(id.0)]);
        if !listed && !others_kept {
            return Err(crate::Error::invalid(
                "no class is kept: --classes and --exclude-classes cancel out",
            ));
        }
        let is_surface = |id: &ClassId| wanted.contains(id) || rules.consistency == Consistency::Off;
        let without_surface = table.classes().iter().filter(|class| !class.surface).map(|class| class.id);
        let without_surface = without_surface.filter(|id| !is_surface(id)).collect();
        let planar = table.classes().iter().filter_map(|class| Some((class.id, class.plane?))).collect();
        let (consistency, border) = (rules.consistency, rules.border);
        let others_estimated = all || others_kept;
        Ok(ClassPolicy {
            kept,
            estimated,
            without_surface,
            planar,
            others_kept,
            others_estimated,
            consistency,
            border,
        })
    }

    /// The same, but `id` is neither kept nor estimated.
    pub fn dropping(mut self, id: ClassId) -> Self {
        let i = usize::from(id.0);
        let both = [(&mut self.kept, self.others_kept), (&mut self.estimated, self.others_estimated)];
        for (wanted, others) in both {
            wanted.resize(wanted.len().max(i + 1), others);
            wanted[i] = false;
        }
        self
    }

    /// Whether a pixel of this class may start a point.
    #[inline]
    pub fn is_candidate(&self, id: impl Into<ClassId>) -> bool {
        let id = id.into();
        self.is_kept(id) && !self.without_surface.contains(&id)
    }

    /// Whether a point of this class belongs in the cloud.
    #[inline]
    pub fn is_kept(&self, id: impl Into<ClassId>) -> bool {
        self.kept.get(usize::from(id.into().0)).copied().unwrap_or(self.others_kept)
    }

    /// Whether depths of pixels of this class are worth estimating.
    #[inline]
    pub fn is_estimated(&self, id: impl Into<ClassId>) -> bool {
        self.estimated.get(usize::from(id.into().0)).copied().unwrap_or(self.others_estimated)
    }

    /// Whether two pixels may be one point as far as their labels go; always with [`Consistency::Off`].
    ///
    /// Give it labels whose borders are void already, see [`super::void_borders`].
    #[inline]
    pub fn agreement(&self, reference: impl Into<ClassId>, neighbor: impl Into<ClassId>) -> Agreement {
        let (a, b) = (reference.into(), neighbor.into());
        if self.consistency == Consistency::Off || a == b || a.is_void() || b.is_void() {
            Agreement::Agrees
        } else {
            Agreement::Differs
        }
    }

    /// The planes that pixels of a class are drawn towards, if any.
    pub fn plane_prior(&self, id: impl Into<ClassId>) -> Option<PlanePrior> {
        let id = id.into();
        self.planar.iter().find(|(class, _)| *class == id).map(|(_, prior)| *prior)
    }

    /// Whether pixels of any class are drawn towards planes.
    pub fn has_plane_priors(&self) -> bool {
        !self.planar.is_empty()
    }

    /// How labels restrict fusion.
    pub fn consistency(&self) -> Consistency {
        self.consistency
    }

    /// Width in depth-map pixels of the band along class borders that counts as void in the check.
    pub fn border(&self) -> u32 {
        self.border
    }

    /// Whether pixels of every class get depths.
    pub fn estimates_everything(&self) -> bool {
        self.others_estimated && self.estimated.iter().all(|&estimated| estimated)
    }

    /// Whether no class is dropped: then labels cannot remove a pixel by themselves.
    pub fn keeps_everything(&self) -> bool {
        self.others_kept && self.without_surface.is_empty() && self.kept.iter().all(|&kept| kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn policy(table: &str, classes: &[&str], exclude: &[&str]) -> Result<ClassPolicy> {
        let rules = ClassRules {
            classes: classes.iter().map(|s| s.to_string()).collect(),
            exclude: exclude.iter().map(|s| s.to_string()).collect(),
            ..ClassRules::default()
        };
        ClassPolicy::new(&ClassTable::builtin(table)?, &rules)
    }

    fn kept(policy: &ClassPolicy, ids: std::ops::RangeInclusive<u16>) -> Vec<u16> {
        ids.filter(|&id| policy.is_kept(id)).collect()
    }

    #[test]
    fn without_rules_everything_is_kept_and_estimated() {
        for policy in [ClassPolicy::default(), policy("openmvs-aerial", &[], &[]).unwrap()] {
            assert!(
                (0..=u16::MAX)
                    .all(|id| policy.is_kept(id) && policy.is_candidate(id) && policy.is_estimated(id))
            );
            assert!(policy.keeps_everything() && policy.estimates_everything());
        }
    }

    #[test]
    fn what_has_no_surface_makes_no_points_unless_it_is_asked_for_or_nothing_is_compared() {
        const SKY: u16 = 2;
        let default = policy("3dom-facade", &[], &[]).unwrap();
        assert_eq!((0..9).filter(|&id| !default.is_candidate(id)).collect::<Vec<u16>>(), [SKY]);
        assert!(default.is_kept(SKY) && default.is_estimated(SKY) && !default.keeps_everything());
        assert!(default.estimates_everything());
        assert!(policy("3dom-facade", &["sky", "door"], &[]).unwrap().is_candidate(SKY));
        let off = ClassRules { consistency: Consistency::Off, ..ClassRules::default() };
        let off = ClassPolicy::new(&ClassTable::builtin("3dom-facade").unwrap(), &off).unwrap();
        assert!(off.is_candidate(SKY) && off.keeps_everything());
    }

    #[test]
    fn classes_keep_only_what_they_name() {
        let policy = policy("3dom-facade", &["Building", "5"], &[]).unwrap();
        assert_eq!(kept(&policy, 0..=u16::MAX), [1, 5]);
        assert!(!policy.keeps_everything() && !policy.estimates_everything());
        assert!(!policy.is_estimated(0) && policy.is_estimated(1) && !policy.is_estimated(60_000));
    }

    #[test]
    fn void_is_kept_by_name_only_among_classes_and_dropped_by_name_only_among_excluded() {
        assert_eq!(kept(&policy("3dom-facade", &["void", "sky"], &[]).unwrap(), 0..=5), [0, 2]);
        assert_eq!(kept(&policy("3dom-facade", &[], &["sky", "obstacle"]).unwrap(), 0..=5), [0, 1, 4, 5]);
        assert_eq!(kept(&policy("3dom-facade", &[], &["void"]).unwrap(), 0..=5), [1, 2, 3, 4, 5]);
        assert_eq!(kept(&policy("openmvs-aerial", &["unclassified", "tree"], &[]).unwrap(), 0..=8), [0, 5]);
    }

    #[test]
    fn exclusion_wins_over_inclusion_and_nothing_left_is_an_error() {
        assert_eq!(kept(&policy("3dom-facade", &["sky", "door"], &["sky"]).unwrap(), 0..=5), [5]);
        let error = policy("3dom-facade", &["sky"], &["sky"]).unwrap_err().to_string();
        assert!(error.contains("no class is kept"), "{error}");
    }

    #[test]
    fn the_table_decides_where_the_user_does_not() {
        let text = "[[class]]\nid = 1\nname = \"wall\"\n[[class]]\nid = 2\nname = \"sky\"\nkeep = false\n\
                    [[class]]\nid = 3\nname = \"tree\"\nkeep = false\nestimate = true\n\
                    [[class]]\nid = 4\nname = \"glass\"\nestimate = false\n";
        let table = ClassTable::from_toml(text, std::path::Path::new("t.toml")).unwrap();
        let policy = ClassPolicy::new(&table, &ClassRules::default()).unwrap();
        assert_eq!(kept(&policy, 0..=4), [0, 1, 4]);
        let estimated: Vec<u16> = (0..=4).filter(|&id| policy.is_estimated(id)).collect();
        assert_eq!(estimated, [0, 1, 3]);
        let rules = ClassRules { classes: vec!["sky".into()], ..ClassRules::default() };
        let policy = ClassPolicy::new(&table, &rules).unwrap();
        assert_eq!(kept(&policy, 0..=4), [2]);
        assert!(policy.is_estimated(2) && policy.is_estimated(3) && !policy.is_estimated(1));
    }

    #[test]
    fn everything_is_estimated_where_labels_decide_nothing_there() {
        let rules = ClassRules {
            classes: vec!["door".into()],
            estimation: LabelEstimation::Off,
            ..ClassRules::default()
        };
        let policy = ClassPolicy::new(&ClassTable::builtin("3dom-facade").unwrap(), &rules).unwrap();
        assert_eq!(kept(&policy, 0..=u16::MAX), [5]);
        assert!((0..=u16::MAX).all(|id| policy.is_estimated(id)));
        let masked = policy.dropping(ClassId(9));
        assert!(!masked.is_estimated(9) && masked.is_estimated(7) && !masked.is_kept(7));
    }

    #[test]
    fn a_class_can_be_dropped_afterwards() {
        let policy = ClassPolicy::default().dropping(ClassId(3));
        assert_eq!(kept(&policy, 0..=5), [0, 1, 2, 4, 5]);
        assert!(!policy.is_estimated(3) && policy.is_estimated(2) && policy.is_estimated(60_000));
        let policy = super::tests::policy("3dom-facade", &["door"], &[]).unwrap().dropping(ClassId(9));
        assert_eq!(kept(&policy, 0..=u16::MAX), [5]);
    }

    #[test]
    fn the_ids_table_takes_numbers_it_has_not_met() {
        let policy = policy("ids", &["class-7", "300"], &[]).unwrap();
        assert_eq!(kept(&policy, 0..=u16::MAX), [7, 300]);
    }

    #[test]
    fn an_unknown_class_is_an_error_with_the_nearest_name() {
        let error = policy("3dom-facade", &["widnow"], &[]).unwrap_err().to_string();
        assert_eq!(error, "class table 3dom-facade has no class \"widnow\"; did you mean \"window\"?");
        let error = policy("cityscapes", &[], &["lamp post"]).unwrap_err().to_string();
        assert!(error.contains("road, sidewalk") && !error.contains("did you mean"), "{error}");
        let error = policy("3dom-facade", &["6"], &[]).unwrap_err().to_string();
        assert!(error.contains("no class \"6\""), "{error}");
    }

    #[test]
    fn void_agrees_with_all_and_classes_only_with_themselves() {
        let mut policy = ClassPolicy { consistency: Consistency::Support, ..ClassPolicy::default() };
        assert_eq!(policy.agreement(1, 1), Agreement::Agrees);
        assert_eq!(policy.agreement(0, 1), Agreement::Agrees);
        assert_eq!(policy.agreement(2, 0), Agreement::Agrees);
        assert_eq!(policy.agreement(2, 1), Agreement::Differs);
        policy.consistency = Consistency::Off;
        assert_eq!(policy.agreement(2, 1), Agreement::Agrees);
    }
}
