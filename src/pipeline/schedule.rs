//! Work on views in stages: a view's next stage begins when what it is made from is there, not when all views are so far.

use super::record::with_threads;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::ViewIndex;
use rayon::Scope;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a stage makes of a view. The order is that of the work on one thread: stage by stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Task {
    pub(super) stage: u32,
    pub(super) view: ViewIndex,
}

/// Which tasks there are, and what each waits for.
///
/// A stage may begin while the one before is in its last views; it waits for all stages before that one, so that maps of
/// no more than three stages are there at a time.
#[derive(Debug)]
pub(super) struct Schedule {
    /// Ascending.
    tasks: Vec<Task>,
    /// By task, the tasks that wait for it.
    dependents: Vec<Vec<usize>>,
    /// By task, how many it waits for.
    waits: Vec<usize>,
    stages: usize,
}

/// How far the work is.
struct State {
    /// Tasks that may begin.
    ready: BTreeSet<usize>,
    /// By task, how many of those it waits for are not done.
    waits: Vec<usize>,
    /// By stage, how many of the tasks up to its end are not done.
    left: Vec<usize>,
    /// What went wrong first; nothing begins after that.
    failed: Option<Error>,
}

impl Schedule {
    /// The work of `stages` stages: `todo` has the views of each, and `needs` tells what a task is made from; of that, what
    /// is no task of an earlier stage is there.
    pub(super) fn new<'a>(
        stages: u32,
        todo: impl Fn(u32) -> &'a [ViewIndex],
        needs: impl Fn(Task) -> Vec<Task>,
    ) -> Self {
        let of_stage = |stage| todo(stage).iter().map(move |&view| Task { stage, view });
        let mut tasks: Vec<Task> = (0..stages).flat_map(of_stage).collect();
        tasks.sort_unstable();
        let at: BTreeMap<Task, usize> = tasks.iter().enumerate().map(|(i, &task)| (task, i)).collect();
        let mut schedule = Schedule {
            dependents: vec![Vec::new(); tasks.len()],
            waits: vec![0; tasks.len()],
            stages: stages as usize,
            tasks: Vec::new(),
        };
        for (task, i) in &at {
            let needed: BTreeSet<Task> = needs(*task).into_iter().filter(|n| n.stage < task.stage).collect();
            for &needed in needed.iter().filter_map(|needed| at.get(needed)) {
                schedule.dependents[needed].push(*i);
                schedule.waits[*i] += 1;
            }
        }
        schedule.tasks = tasks;
        schedule
    }

    /// Works on all tasks with the threads of the pool, always on the first of those that may begin. `ended` is told of
    /// every stage once it and those before it are complete, in any order.
    ///
    /// No thread waits for another: what a task lets begin is handed to the pool when that task is done.
    ///
    /// # Errors
    /// The first one of `work`; no further task begins then.
    pub(super) fn run(
        &self,
        work: impl Fn(Task) -> Result<()> + Sync,
        ended: impl Fn(u32) + Sync,
    ) -> Result<()> {
        let up_to = |stage| self.tasks.iter().filter(|task| task.stage as usize <= stage).count();
        let mut state = State {
            ready: BTreeSet::new(),
            waits: self.waits.clone(),
            left: (0..self.stages).map(up_to).collect(),
            failed: None,
        };
        (0..self.tasks.len()).for_each(|task| self.admit(&mut state, task));
        let at_once = state.ready.len();
        (0..self.stages).filter(|&stage| state.left[stage] == 0).for_each(|stage| ended(stage as u32));
        let running = Running { schedule: self, state: Mutex::new(state), work, ended };
        rayon::scope(|scope| running.spawn(scope, at_once));
        let state = running.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        state.failed.map_or(Ok(()), Err)
    }

    /// Makes a task ready if it waits for nothing.
    fn admit(&self, state: &mut State, task: usize) {
        let open = match self.tasks[task].stage.checked_sub(2) {
            Some(before) => state.left[before as usize] == 0,
            None => true,
        };
        if open && state.waits[task] == 0 {
            state.ready.insert(task);
        }
    }

    /// Counts a task as done; returns how many may begin by that, and which stages have ended.
    fn finish(&self, state: &mut State, done: usize) -> (usize, Vec<u32>) {
        let before = state.ready.len();
        let mut ended = Vec::new();
        for stage in self.tasks[done].stage as usize..self.stages {
            state.left[stage] -= 1;
            if state.left[stage] == 0 {
                ended.push(stage as u32);
            }
        }
        for &dependent in &self.dependents[done] {
            state.waits[dependent] -= 1;
            self.admit(state, dependent);
        }
        // Tasks of a stage that opens now and wait for nothing else.
        for stage in &ended {
            let opened = self.tasks.iter().enumerate().filter(|(_, task)| task.stage == stage + 2);
            opened.for_each(|(task, _)| self.admit(state, task));
        }
        (state.ready.len() - before, ended)
    }
}

/// A schedule that is worked on.
struct Running<'a, W, E> {
    schedule: &'a Schedule,
    state: Mutex<State>,
    work: W,
    ended: E,
}

impl<W: Fn(Task) -> Result<()> + Sync, E: Fn(u32) + Sync> Running<'_, W, E> {
    /// Hands `count` jobs to the pool, one for every task that has become ready; which of these a job takes is decided when
    /// it begins.
    fn spawn<'s>(&'s self, scope: &Scope<'s>, count: usize) {
        for _ in 0..count {
            scope.spawn(|scope| self.next(scope));
        }
    }

    fn next<'s>(&'s self, scope: &Scope<'s>) {
        let Some(task) = self.take() else { return };
        match (self.work)(self.schedule.tasks[task]) {
            Ok(()) => {
                let (released, ended) = self.schedule.finish(&mut self.lock(), task);
                self.spawn(scope, released);
                ended.into_iter().for_each(&self.ended);
            }
            Err(error) => drop(self.lock().failed.get_or_insert(error)),
        }
    }

    fn take(&self) -> Option<usize> {
        let mut state = self.lock();
        if state.failed.is_some() { None } else { state.ready.pop_first() }
    }

    /// A panic of a task leaves the state as it was before.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Works on every view, `at_once` at a time or as many as the pool has threads; stops before the next one when that is
/// wanted.
pub(super) fn for_each_view(
    views: &[ViewIndex],
    at_once: usize,
    progress: &Progress,
    work: impl Fn(ViewIndex) -> Result<()> + Sync + Send,
) -> Result<()> {
    let all = || {
        views.par_iter().with_max_len(1).try_for_each(|&view| {
            progress.check()?;
            work(view)
        })
    };
    at_a_time(at_once, all)
}

/// Does `all` with `at_once` threads or as many as the pool has.
pub(super) fn at_a_time(at_once: usize, all: impl FnOnce() -> Result<()> + Send) -> Result<()> {
    if at_once < rayon::current_num_threads() { with_threads(at_once, all) } else { all() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    const VIEWS: usize = 6;

    /// Every view needs itself and its neighbours in a row.
    fn row(stages: u32) -> Schedule {
        let views: Vec<ViewIndex> = (0..VIEWS as u32).map(ViewIndex).collect();
        Schedule::new(
            stages,
            |_| &views,
            |task| {
                let view = task.view.0;
                let needed = [Some(view), view.checked_sub(1), Some(view + 1)].into_iter().flatten();
                let before = task.stage.wrapping_sub(1);
                needed.map(|view| Task { stage: before, view: ViewIndex(view) }).collect()
            },
        )
    }

    /// The order in which tasks began and ended with so many threads: (task, whether it ended).
    fn order(schedule: &Schedule, threads: usize, pause: impl Fn(Task) + Sync) -> Vec<(Task, bool)> {
        let log = Mutex::new(Vec::new());
        with_threads(threads, || {
            schedule.run(
                |task| {
                    log.lock().unwrap().push((task, false));
                    pause(task);
                    log.lock().unwrap().push((task, true));
                    Ok(())
                },
                |_| (),
            )
        })
        .unwrap();
        log.into_inner().unwrap()
    }

    #[test]
    fn one_thread_works_stage_by_stage() {
        let begun: Vec<Task> =
            order(&row(4), 1, |_| ()).iter().filter(|(_, ended)| !ended).map(|(task, _)| *task).collect();
        assert_eq!(begun.len(), 4 * VIEWS);
        assert!(begun.is_sorted(), "{begun:?}");
    }

    #[test]
    fn no_task_begins_before_what_it_needs() {
        for threads in [2, 3, 5] {
            let order = order(&row(5), threads, |_| ());
            let at = |task: Task, ended| order.iter().position(|e| *e == (task, ended)).unwrap();
            for &(task, _) in order.iter().filter(|(task, ended)| task.stage > 0 && !ended) {
                let begins = at(task, false);
                for view in task.view.0.saturating_sub(1)..=(task.view.0 + 1).min(VIEWS as u32 - 1) {
                    assert!(at(Task { stage: task.stage - 1, view: ViewIndex(view) }, true) < begins);
                }
                for early in order.iter().filter(|(other, _)| other.stage + 2 <= task.stage) {
                    assert!(at(early.0, true) < begins, "{task:?} before the end of {early:?}");
                }
            }
        }
    }

    #[test]
    fn a_stage_begins_while_the_last_view_of_the_one_before_is_in_hand() {
        let last = Task { stage: 0, view: ViewIndex(VIEWS as u32 - 1) };
        let ahead = AtomicUsize::new(0);
        // The last view of the first stage ends when another thread has made all that does not need it.
        let order = order(&row(2), 2, |task| {
            if task.stage == 1 {
                ahead.fetch_add(1, Ordering::SeqCst);
            }
            while task == last && ahead.load(Ordering::SeqCst) < VIEWS - 2 {
                std::thread::yield_now();
            }
        });
        let end = order.iter().position(|e| *e == (last, true)).unwrap();
        let before = order[..end].iter().filter(|(task, ended)| task.stage == 1 && !ended).count();
        assert!(before >= VIEWS - 2, "{order:?}");
    }

    #[test]
    fn stages_end_once_each_and_empty_ones_at_once() {
        let views = [ViewIndex(3)];
        let todo = |stage| if stage == 1 || stage == 2 { &views[..] } else { &[] };
        let schedule = Schedule::new(4, todo, |task| vec![Task { stage: task.stage - 1, ..task }]);
        let ended = Mutex::new(Vec::new());
        let log = |text: String| ended.lock().unwrap().push(text);
        let work = |task: Task| {
            log(format!("made {}", task.stage));
            Ok(())
        };
        with_threads(1, || schedule.run(work, |stage| log(format!("end {stage}")))).unwrap();
        assert_eq!(ended.into_inner().unwrap(), ["end 0", "made 1", "end 1", "made 2", "end 2", "end 3"]);
    }

    #[test]
    fn the_first_error_is_told_and_nothing_begins_after_it() {
        let begun = AtomicUsize::new(0);
        let failed = with_threads(1, || {
            row(3).run(
                |task| {
                    begun.fetch_add(1, Ordering::SeqCst);
                    match task.view.0 {
                        0 | 1 => Ok(()),
                        view => Err(Error::invalid(format!("view {view}"))),
                    }
                },
                |stage| panic!("stage {stage} did not end"),
            )
        });
        assert_eq!(failed.unwrap_err().to_string(), "view 2");
        assert_eq!(begun.into_inner(), 3);
    }

    #[test]
    fn nothing_to_do_is_done() {
        let schedule = Schedule::new(0, |_| &[], |_| Vec::new());
        schedule.run(|_| Err(Error::invalid("no")), |_| ()).unwrap();
    }
}
