# Everything from a fresh checkout with only python3 (3.11 to 3.13, with venv) and make.
# A stamp in the environment keeps a second run from installing again.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMPS := $(VENV)/.stamps

.PHONY: help demo test test-slow test-learn statistics lint format docs benchmark reproduce clean

help:
	@echo "make demo       install into $(VENV) and calibrate a synthetic endoscope (demo-output/)"
	@echo "make test       run the tests"
	@echo "make test-slow  run the experiments of minutes too"
	@echo "make test-learn run the tests of the decoder's training (PyTorch goes into $(VENV))"
	@echo "make statistics compare stated standard deviations with simulated noise (SEEDS=100)"
	@echo "make lint       ruff and pyright"
	@echo "make format     let ruff mend the layout"
	@echo "make docs       build the documentation (site/)"
	@echo "make benchmark  compare with pycolmap and the published solver (benchmark-output/)"
	@echo "make reproduce  run the paper's experiments (reproduce-output/), write docs/results.md"

demo: $(STAMPS)/core
	$(BIN)/mitsuba-endo demo --out demo-output

# Files stay together: what a file's tests share is made once.
WORKERS := -n auto --maxprocesses 4 --dist loadfile

test: $(STAMPS)/test
	$(BIN)/python -m pytest $(WORKERS)

test-slow: $(STAMPS)/test
	$(BIN)/python -m pytest $(WORKERS) -m "slow or not slow"

# Imported first, because without them the tests would be skipped.
test-learn: $(STAMPS)/test $(STAMPS)/learn
	$(BIN)/python -c "import torch, onnx, onnxscript, onnxruntime, h5py"
	$(BIN)/python -m pytest $(WORKERS) -m "slow or not slow" tests/learn tests/dataset/test_reader.py

SEEDS ?= 100

statistics: $(STAMPS)/test
	$(BIN)/python -m scripts.statistics_study --seeds $(SEEDS)

lint: $(STAMPS)/lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

format: $(STAMPS)/lint
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(STAMPS)/docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --site-dir site

benchmark: $(STAMPS)/benchmark
	$(BIN)/python scripts/benchmark.py --out benchmark-output

reproduce: $(STAMPS)/reproduce
	$(BIN)/python scripts/reproduce_all.py --out reproduce-output --page docs/results.md

clean:
	rm -rf $(VENV) build *.egg-info demo-output benchmark-output reproduce-output site

$(STAMPS)/venv:
	$(PYTHON) -m venv $(VENV)
	mkdir -p $(STAMPS)
	touch $@

$(STAMPS)/core: $(STAMPS)/venv pyproject.toml
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(STAMPS)/test $(STAMPS)/lint $(STAMPS)/docs $(STAMPS)/learn $(STAMPS)/benchmark $(STAMPS)/reproduce: $(STAMPS)/%: $(STAMPS)/core
	$(BIN)/python -m pip install --quiet --editable ".[$*]"
	touch $@
