.PHONY: demo test quick

# A simulated home is mapped, filmed, uploaded over HTTP and aligned; then the server stays up to be looked at. The first
# call compiles for about 15 minutes on two cores.
demo:
	cargo run --release -- demo

# All tests. VIOLA_TEST_DATA names the folder with the real recordings. What was skipped is listed at the end.
test:
	tests/run

# Unit tests, the crates' own tests and the rules of the house: what to run after every edit.
quick:
	cargo test --workspace --lib --test house --test named_rooms
