//! Steps of stages that overlap, told of one stage after the other.

use crate::progress::{Progress, Stage, Steps};
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

/// Counts the steps of stages of which one may begin before the one ahead of it is complete. What is done of a later stage is
/// told when those before it are complete.
#[derive(Debug)]
pub(super) struct OrderedSteps<'a> {
    progress: &'a Progress,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    /// Stages that are not told of yet, how many steps each has, and how many of these are done.
    waiting: VecDeque<(Stage, usize, usize)>,
    /// The stage that is told of, and how many steps it lacks.
    current: Option<(Stage, Steps, usize)>,
}

impl<'a> OrderedSteps<'a> {
    /// Tells of `stages`, each with the number of its steps, in this order; those without steps are left out.
    pub(super) fn start(progress: &'a Progress, stages: impl IntoIterator<Item = (Stage, usize)>) -> Self {
        let stages = stages.into_iter().filter(|(_, total)| *total > 0);
        let waiting = stages.map(|(stage, total)| (stage, total, 0)).collect();
        let mut state = State { waiting, current: None };
        state.advance(progress);
        OrderedSteps { progress, state: Mutex::new(state) }
    }

    /// One more step of `stage` is done.
    pub(super) fn step(&self, stage: Stage) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let state = &mut *state;
        match &mut state.current {
            Some((current, steps, lacking)) if *current == stage => {
                steps.step();
                *lacking = lacking.saturating_sub(1);
            }
            _ => {
                let of_stage = state.waiting.iter_mut().filter(|(other, ..)| *other == stage);
                of_stage.for_each(|(.., done)| *done += 1);
            }
        }
        state.advance(self.progress);
    }
}

impl State {
    /// Starts the next stages while the current one is complete.
    fn advance(&mut self, progress: &Progress) {
        while self.current.as_ref().is_none_or(|(.., lacking)| *lacking == 0) {
            let Some((stage, total, done)) = self.waiting.pop_front() else { return };
            let steps = progress.start(stage, total);
            (0..done).for_each(|_| steps.step());
            self.current = Some((stage, steps, total.saturating_sub(done)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::{Event, Listener};
    use std::sync::Arc;

    #[derive(Default)]
    struct Recorder(Mutex<Vec<(Stage, usize, usize)>>);

    impl Listener for Recorder {
        fn event(&self, _: &Event) {}
        fn steps(&self, stage: Stage, done: usize, total: usize) {
            self.0.lock().unwrap().push((stage, done, total));
        }
    }

    #[test]
    fn overlapping_stages_are_told_one_after_the_other() {
        let recorder = Arc::new(Recorder::default());
        let progress = Progress::new(recorder.clone());
        let (first, second, third) = (Stage::Estimate, Stage::Filter, Stage::Fuse);
        let steps = OrderedSteps::start(&progress, [(Stage::Merge, 0), (first, 2), (second, 2), (third, 1)]);
        let told = || std::mem::take(&mut *recorder.0.lock().unwrap());
        [first, second, second].into_iter().for_each(|stage| steps.step(stage));
        assert_eq!(told(), [(first, 0, 2), (first, 1, 2)]);
        steps.step(first);
        assert_eq!(told(), [(first, 2, 2), (second, 0, 2), (second, 1, 2), (second, 2, 2), (third, 0, 1)]);
        steps.step(third);
        assert_eq!(told(), [(third, 1, 1)]);
    }
}
