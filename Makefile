# What a person types. Everything is built in the release profile: the tests are statistical.
.PHONY: demo test bench bench-ci bench-record bench-scaling lint

# rustup's folder, where a shell has not been told of it yet.
export PATH := $(PATH):$(HOME)/.cargo/bin

# Installs what is missing, builds, and renders the built-in Cornell box into out/.
demo:
	./setup
	cargo build --release
	mkdir -p out
	target/release/gdpt render builtin:cornell-box -o out/cornell-box.exr -o out/cornell-box.png

# Installs what is missing and runs every test; where OIDN_DIR is set, those of the denoiser too.
test:
	./setup --browser
	cargo test --release --workspace $(if $(OIDN_DIR),--features denoise)

# Criterion benches, their pages in target/criterion/, then one table of ratios and targets, also in target/bench.md.
# One row again: cargo bench --bench table -- NAME [--quick]; the names: cargo bench --bench table -- --list
bench:
	./setup
	cargo bench --bench accel --bench shade --bench shift --bench reconstruct --bench render
	cargo bench --bench table

# Every bench once, then ratios and counted instructions against benches/expected.toml; fails out of band.
bench-ci:
	./setup --bench
	cargo bench -- --test
	cargo bench --bench ci

# Stores what is measured now as what bench-ci compares with.
bench-record:
	./setup --bench
	cargo bench --bench ci -- --record

# Time and memory as the work grows: plots and exponents in target/bench-scaling/.
bench-scaling:
	./setup
	cargo bench --bench scaling

# Formatting, clippy and the documentation, each without a warning.
lint:
	./setup
	cargo fmt --all -- --check
	cargo clippy --workspace --all-targets --release -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --release
