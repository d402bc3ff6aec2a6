# What a person types. Everything is built in the release profile: the tests are statistical.
.PHONY: demo test bench lint

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

# Criterion benches; they print the ratios that matter and assert nothing.
bench:
	./setup
	cargo bench

# Formatting, clippy and the documentation, each without a warning.
lint:
	./setup
	cargo fmt --all -- --check
	cargo clippy --workspace --all-targets --release -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --release
