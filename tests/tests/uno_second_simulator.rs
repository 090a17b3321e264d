//! The same image on a second, independent simulator: agreement is not with one program's mistakes.

use phasewalk_firmware::message::State;
use phasewalk_tests::avr8js::Avr8js;
use phasewalk_tests::board::{Pin, Uno};
use phasewalk_tests::random::Random;
use phasewalk_tests::session::{MS, SECOND, Session, Simulator, deviations, image, paper, pin_of};

/// The paper's sequence under a flooded line; the pins' edges and what the board has told.
fn run<S: Simulator>(board: S) -> (Vec<(Pin, u64, bool)>, u64) {
    let plan = paper();
    let mut session = Session::new(board);
    session.hello();
    session.arm(&plan);
    session.begin();
    session.run_flooded(plan.length() + 30 * MS, &mut Random::new(8));
    assert_eq!(session.finish(SECOND).state, State::Finished);
    let edges = session.board.edges();
    let beside = deviations(&edges, &plan);
    let worst = beside.iter().map(|cycles| cycles.unsigned_abs()).max().unwrap_or(0);
    let outputs = phasewalk_firmware::channel::Channel::ALL.map(pin_of);
    let mut edges: Vec<_> = edges
        .into_iter()
        .filter(|edge| outputs.contains(&edge.pin))
        .map(|edge| (edge.pin, edge.cycle, edge.level))
        .collect();
    edges.sort_unstable();
    let first = edges.iter().map(|edge| edge.1).min().unwrap_or(0);
    edges.iter_mut().for_each(|edge| edge.1 -= first);
    (edges, worst)
}

#[test]
fn the_papers_sequence_is_the_same_on_both() {
    let (second, beside) = run(Avr8js::load(&image().with_extension("hex")));
    println!("avr8js: {} edges, at most {beside} cycles beside the plan", second.len());
    assert!(beside <= 1, "{beside} cycles beside the plan");
    let (first, _) = run(Uno::load(&image()).expect("the image can be loaded"));
    assert_eq!(first.len(), second.len());
    for (first, second) in first.iter().zip(&second) {
        assert_eq!((first.0, first.2), (second.0, second.2));
        assert!(first.1.abs_diff(second.1) <= 1, "{first:?} {second:?}");
    }
}
