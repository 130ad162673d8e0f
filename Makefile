# Everyday targets; each installs what it misses (scripts/setup.sh). CI runs .ci/run.
SCENE ?= cornell
CARGO ?= cargo
TARGET_DIR := $(or $(CARGO_TARGET_DIR),target)
DATA := $(or $(XDG_DATA_HOME),$(HOME)/.local/share)
INSTALLED = $(or $(CARGO_INSTALL_ROOT),$(CARGO_HOME),$(HOME)/.cargo)/bin/finalgather

.PHONY: help setup render check test wheel python-test figures bench install
.DEFAULT_GOAL := help

help: ## List the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1|\2/p' $(MAKEFILE_LIST) | while IFS='|' read -r name text; do printf '%-18s%s\n' "$$name" "$$text"; done

setup: ## Install what a render needs and is missing
	@scripts/setup.sh

render: setup ## Render scenes/$(SCENE).toml to out/ as PNG and EXR; SCENE=cornell by default
	$(CARGO) build --release --locked --package finalgather
	mkdir -p out
	$(TARGET_DIR)/release/finalgather render scenes/$(SCENE).toml -o out/$(SCENE).png -o out/$(SCENE).exr

install: setup ## Install the tool, its manual pages and completions of bash, zsh and fish, for this user
	$(CARGO) install --locked --path .
	mkdir -p $(DATA)/man/man1 $(DATA)/bash-completion/completions $(DATA)/zsh/site-functions $(DATA)/fish/vendor_completions.d
	$(INSTALLED) man $(DATA)/man/man1
	$(INSTALLED) completions bash > $(DATA)/bash-completion/completions/finalgather
	$(INSTALLED) completions zsh > $(DATA)/zsh/site-functions/_finalgather
	$(INSTALLED) completions fish > $(DATA)/fish/vendor_completions.d/finalgather.fish
	@echo 'zsh needs this before compinit in ~/.zshrc: fpath+=$(DATA)/zsh/site-functions'

check: ## Check format, lints, unit tests, imports among modules and shaders: a minute, once dependencies are built
	@scripts/setup.sh --tests
	$(CARGO) fmt --check
	$(CARGO) clippy --release --locked --lib --bins -- -D warnings
	$(CARGO) test --release --locked --lib --bins --test layout --test gl_shaders

test: ## Run all tests, those of the GL part also on a driver that offers no more than OpenGL 3.3
	@scripts/setup.sh --tests
	$(CARGO) test --release --locked
	GALLIUM_DRIVER=softpipe $(CARGO) test --release --locked --test 'gl_*'

wheel: ## Build the Python package to target/wheels/
	@scripts/setup.sh --python
	scripts/python.sh wheel

python-test: ## Build the Python package and run its tests
	@scripts/setup.sh --tests
	$(CARGO) build --release --locked
	scripts/python.sh test

figures: setup ## Measure and draw all figures to paper_figures/out/index.html; about 40 minutes on two cores
	$(CARGO) build --release --locked --package paper_figures
	$(TARGET_DIR)/release/paper_figures

bench: setup ## Measure all pipelines and rays on the CPU to paper_figures/runs/DATE-MACHINE/; about 25 minutes on two cores
	$(CARGO) build --release --locked --package paper_figures
	$(TARGET_DIR)/release/paper_figures --only bench --only scaling --only time_to_error --record
