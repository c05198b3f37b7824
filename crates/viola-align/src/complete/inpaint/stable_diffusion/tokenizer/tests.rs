use super::*;

fn tokenizer() -> Tokenizer {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/models/stable_diffusion/tokenizer.json");
    Tokenizer::new(serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()).unwrap()
}

/// Returns the tokens between start and end.
fn tokens(text: &str) -> Vec<String> {
    let tokenizer = tokenizer();
    let ids = tokenizer.encode(text).unwrap();
    assert_eq!((ids.len(), ids[0]), (77, i64::from(tokenizer.start)));
    let name =
        |id: &i64| tokenizer.vocab.iter().find(|(_, known)| i64::from(**known) == *id).unwrap().0.clone();
    ids[1..].iter().take_while(|id| **id != i64::from(tokenizer.end)).map(name).collect()
}

/// The expected tokens are those of `CLIPTokenizer` of `transformers`.
#[test]
fn words_are_divided_by_rank() {
    for (text, want) in [
        ("", ""),
        ("a photo of an EMPTY  room", "a</w> pho to</w> of</w> an</w> empty</w> r oom</w>"),
        ("realistic", "real isti c</w>"),
        ("room's 12 ft., isn't", "r oom</w> ' s</w> 1</w> 2</w> f t</w> . ,</w> is n</w> ' t</w>"),
    ] {
        assert_eq!(tokens(text).join(" "), want, "{text}");
    }
}

#[test]
fn other_prompts_are_refused() {
    for (text, told) in [
        ("ein geräumiges Zimmer", "plain ASCII"),
        ("a\nroom", "plain ASCII"),
        ("<|endoftext|>", "plain ASCII"),
        (&"a ".repeat(76), "76 tokens; at most 75"),
    ] {
        let error = tokenizer().encode(text).unwrap_err();
        assert!(error.contains(told), "{text}: {error}");
    }
    assert!(tokenizer().encode(&"a ".repeat(75)).is_ok());
}

#[test]
fn vocabularies_with_gaps_are_refused() {
    let words = |merges: &[(&str, &str)], length| Words {
        vocab: ["a", "b", "ab"].map(String::from).into_iter().zip(0..).collect(),
        merges: merges.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect(),
        start: 0,
        end: 1,
        pad: 1,
        length,
    };
    assert!(Tokenizer::new(words(&[("a", "b")], 77)).is_ok());
    assert!(Tokenizer::new(words(&[("a", "c")], 77)).is_err());
    assert!(Tokenizer::new(words(&[("b", "a")], 77)).is_err());
    assert!(Tokenizer::new(words(&[], 2)).is_err());
    assert!(Tokenizer::new(words(&[], 100_000)).is_err());
    assert!(Tokenizer::new(words(&[], 77)).unwrap().encode("a").is_err());
}
