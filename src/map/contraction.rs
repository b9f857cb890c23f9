//! Degenerate lanes taken out of a graph, with the ways through them kept.

/// Which lanes of a graph stay, and what stands for the others.
pub struct Contraction {
    /// Lanes that stay, ascending.
    pub kept: Vec<usize>,
    /// For every lane the kept ones that it stands for: itself, or those it leads into.
    pub stands_for: Vec<Vec<usize>>,
}

impl Contraction {
    /// Take out degenerate lanes that lead somewhere. One that leads nowhere is the end of a
    /// road and stays: there is nothing that could stand for it.
    pub fn new(degenerate: &[bool], successors: &[Vec<usize>]) -> Self {
        let stands_for: Vec<Vec<usize>> = (0..degenerate.len())
            .map(|lane| {
                let through = beyond(lane, degenerate, successors);
                if !degenerate[lane] || through.is_empty() { vec![lane] } else { through }
            })
            .collect();
        let kept = (0..degenerate.len()).filter(|lane| stands_for[*lane] == [*lane]).collect();
        Contraction { kept, stands_for }
    }
}

/// The lanes that a degenerate one leads into, through others of its kind, ascending.
fn beyond(lane: usize, degenerate: &[bool], successors: &[Vec<usize>]) -> Vec<usize> {
    if !degenerate[lane] {
        return Vec::new();
    }
    let (mut found, mut seen, mut open) = (Vec::new(), vec![lane], vec![lane]);
    while let Some(lane) = open.pop() {
        for next in &successors[lane] {
            if !degenerate[*next] {
                found.push(*next);
            } else if !seen.contains(next) {
                seen.push(*next);
                open.push(*next);
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}
