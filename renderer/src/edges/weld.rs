//! Finding vertices that are at the same place.

/// Gives every position the index of the first position that equals it exactly, counted without repeats, and returns
/// the positions without repeats. Zero and minus zero are equal; a coordinate that is not a number equals itself.
pub fn weld(positions: &[[f32; 3]]) -> (Vec<u32>, Vec<[f32; 3]>) {
    let slots = (positions.len() * 2).next_power_of_two().max(16);
    let mut table = vec![u32::MAX; slots];
    let mut unique: Vec<[f32; 3]> = Vec::with_capacity(positions.len());
    let mut keys: Vec<[u32; 3]> = Vec::with_capacity(positions.len());
    let ids = positions
        .iter()
        .map(|position| {
            let position = position.map(|x| x + 0.0);
            let key = position.map(f32::to_bits);
            let mut slot = hash(key) as usize & (slots - 1);
            loop {
                let id = table[slot];
                if id == u32::MAX {
                    table[slot] = unique.len() as u32;
                    unique.push(position);
                    keys.push(key);
                    return unique.len() as u32 - 1;
                }
                if keys[id as usize] == key {
                    return id;
                }
                slot = (slot + 1) & (slots - 1);
            }
        })
        .collect();
    (ids, unique)
}

fn hash(key: [u32; 3]) -> u64 {
    let mut h = 0x9e37_79b9_7f4a_7c15_u64;
    for k in key {
        h = (h ^ u64::from(k)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        h ^= h >> 32;
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_positions_get_one_index() {
        let (ids, unique) = weld(&[
            [0.0, 1.0, 2.0],
            [0.5, 0.5, 0.5],
            [-0.0, 1.0, 2.0],
            [0.5, 0.5, 0.500_000_06],
            [0.5, 0.5, 0.5],
        ]);
        assert_eq!(ids, [0, 1, 0, 2, 1]);
        assert_eq!(unique.len(), 3);
    }
}
