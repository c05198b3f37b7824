//! CLIP's tokenizer (Radford et al., "Learning Transferable Visual Models From Natural Language Supervision",
//! 2021): frequent pairs of letters become one token (Sennrich et al., 2016).

use serde::Deserialize;
use std::collections::HashMap;

/// Maximum length of a text, in tokens, that a file may ask for. Known encoders take at most 77.
const MAX_LENGTH: usize = 1024;
/// Endings that are cut off a word as one piece, in the order of matching.
const ENDINGS: [&str; 7] = ["'s", "'t", "'re", "'ve", "'m", "'ll", "'d"];
/// Marks the last letter of a word.
const END_OF_WORD: &str = "</w>";

/// `tokenizer.json` as the export writes it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Words {
    vocab: HashMap<String, u32>,
    /// Pairs that are joined, the most frequent first.
    merges: Vec<(String, String)>,
    start: u32,
    end: u32,
    pad: u32,
    length: usize,
}

pub(super) struct Tokenizer {
    vocab: HashMap<String, u32>,
    /// For a pair of tokens, its rank and the token that it becomes.
    merges: HashMap<(u32, u32), (usize, u32)>,
    start: u32,
    end: u32,
    pad: u32,
    length: usize,
}

impl Tokenizer {
    pub(super) fn new(words: Words) -> Result<Tokenizer, String> {
        let Words { vocab, merges: pairs, start, end, pad, length } = words;
        if !(3..=MAX_LENGTH).contains(&length) {
            return Err(format!("its texts have {length} tokens; 3 to {MAX_LENGTH} are run"));
        }
        let id = |token: &str| {
            vocab.get(token).copied().ok_or_else(|| format!("its vocabulary lacks {token:?} of its merges"))
        };
        let mut merges = HashMap::with_capacity(pairs.len());
        for (rank, (left, right)) in pairs.iter().enumerate() {
            // The first of two equal pairs counts.
            let joined = (rank, id(&format!("{left}{right}"))?);
            merges.entry((id(left)?, id(right)?)).or_insert(joined);
        }
        Ok(Tokenizer { vocab, merges, start, end, pad, length })
    }

    /// Returns the tokens of a text, framed and padded to the encoder's length.
    pub(super) fn encode(&self, text: &str) -> Result<Vec<i64>, String> {
        // Other scripts need Unicode's normal forms; English does not. Control characters and the names of
        // the framing tokens have no place in a prompt.
        let plain = |c: char| c.is_ascii_graphic() || c == ' ';
        if !text.chars().all(plain) || text.contains("<|") {
            return Err(format!("the prompt {text:?} is not of plain ASCII letters, digits and signs"));
        }
        let text = text.to_ascii_lowercase();
        let mut ids = vec![i64::from(self.start)];
        for piece in text.split(' ').flat_map(pieces) {
            ids.extend(self.tokens(piece)?.into_iter().map(i64::from));
        }
        ids.push(i64::from(self.end));
        if ids.len() > self.length {
            let most = self.length - 2;
            return Err(format!("the prompt {text:?} has {} tokens; at most {most} are read", ids.len() - 2));
        }
        ids.resize(self.length, i64::from(self.pad));
        Ok(ids)
    }

    fn tokens(&self, piece: &str) -> Result<Vec<u32>, String> {
        let letters: Vec<char> = piece.chars().collect();
        let mut tokens = Vec::with_capacity(letters.len());
        for (place, letter) in letters.iter().enumerate() {
            let end = if place + 1 == letters.len() { END_OF_WORD } else { "" };
            let token = format!("{letter}{end}");
            let id = self.vocab.get(&token).ok_or_else(|| format!("its vocabulary lacks {token:?}"))?;
            tokens.push(*id);
        }
        loop {
            let joined = |at: &usize| self.merges.get(&(tokens[*at], tokens[*at + 1]));
            let best = (0..tokens.len().saturating_sub(1))
                .filter_map(|at| joined(&at).map(|(rank, token)| (*rank, at, *token)))
                .min();
            let Some((_, at, token)) = best else { return Ok(tokens) };
            tokens[at] = token;
            tokens.remove(at + 1);
        }
    }
}

/// Returns the pieces of a lower-case word that are tokenized separately: an ending after an apostrophe, a
/// run of letters, one digit, or a run of other signs.
fn pieces(word: &str) -> Vec<&str> {
    let mut pieces = Vec::new();
    let mut rest = word;
    while let Some(first) = rest.chars().next() {
        let run = |of: fn(char) -> bool| rest.find(|c: char| !of(c)).unwrap_or(rest.len());
        let length = match ENDINGS.iter().find(|ending| rest.starts_with(**ending)) {
            Some(ending) => ending.len(),
            None if first.is_ascii_digit() => 1,
            None if first.is_ascii_alphabetic() => run(|c| c.is_ascii_alphabetic()),
            None => run(|c| !c.is_ascii_alphanumeric()),
        };
        let (piece, after) = rest.split_at(length);
        pieces.push(piece);
        rest = after;
    }
    pieces
}

#[cfg(test)]
mod tests;
