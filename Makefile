# Each target makes the virtual environment that it needs: only Python 3.11+, make and git are asked for.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DOCS_STAMP := $(VENV)/.installed-docs
PAGES := README.md CHANGELOG.md CONTRIBUTING.md agents world protocol deploy tests

.PHONY: demo test test-fast test-wheel test-hosts test-hosts-short test-campaign peers peers-learn lint bench bench-table soak fuzz fuzz-stops model planted hunt why mutants coverage same pages pictures docs clean setup test-driving

COMPUTE := 'not processes and not hosts and not campaign'
TEAMS := 'processes and not hosts and not campaign and not wheel'
AGAIN := $(BIN)/pytest --last-failed --last-failed-no-failures none
ALONE := echo 'failed beside others; once more, alone:'; $(AGAIN)

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[all]'
	touch $(STAMP)

demo: $(STAMP)
	$(BIN)/lfa run paper_path1 --fault 'kill leader at 20 s'
	@echo 'to click a robot dead yourself: $(BIN)/lfa web (prints an address, http://127.0.0.1:8642/?token=...)'

# First what computes, on two workers; then the teams of real processes, two at a time, for they keep time and mostly wait.
# What a busy machine kept from keeping time is tried once more, alone: a fault of the code fails there too.
# Bytecode, also where the environment says not to write any: without it each of some 600 processes compiles its own.
test test-fast: export PYTHONDONTWRITEBYTECODE =
test test-fast: export PYTHONPYCACHEPREFIX = $(CURDIR)/$(VENV)/bytecode
test: $(STAMP)
	$(BIN)/pytest -n 2 --dist load -m $(COMPUTE) || { $(ALONE) -m $(COMPUTE); }
	$(BIN)/pytest -n 2 --dist load -m $(TEAMS) || { $(ALONE) -m $(TEAMS); }

# Programs of others that tests of the ROS side talk to, each in an environment of its own; their tests are skipped
# without them. Fetches some 400 MB once.
peers: .peers/genuine/.installed .peers/sdk/.installed .peers/foxglove/.installed

.peers/foxglove/.installed: tests/deploy/ros/peers/foxglove_package.json
	mkdir -p $(@D)
	cp $< $(@D)/package.json
	npm install --prefix $(@D) --silent --no-audit --no-fund
	touch $@

.peers/%/.installed: tests/deploy/ros/peers/%.txt
	$(PYTHON) -m venv .peers/$*
	.peers/$*/bin/python -m pip install --quiet --disable-pip-version-check -r $<
	touch $@

# Simulators of others that `lfa bench learn` measures beside this one. Fetches some 3 GB once.
peers-learn: .peers/learn/.installed

.peers/learn/.installed: tests/deploy/bench/learn_peers.txt
	$(PYTHON) -m venv .peers/learn
	.peers/learn/bin/python -m pip install --quiet --disable-pip-version-check -r $<
	touch $@

# The tests that start no process.
test-fast: $(STAMP)
	$(BIN)/pytest -n 2 --dist load -m $(COMPUTE)

# The wheel, built and installed with and without extras: fetches packages.
test-wheel: $(STAMP)
	$(BIN)/pytest -m wheel tests/deploy/test_installed_wheel.py

# Machines as network namespaces, each with its own router and sshd; skipped, with the reason, where that cannot be.
# The whole of it, with bars that must be met; the short form asks what happens, not how fast: what failed, perhaps for
# want of processor time, is tried once more, and the output says so.
test-hosts: $(STAMP)
	$(BIN)/pytest -m hosts -rs --bars tests/hosts

test-hosts-short: $(STAMP)
	$(BIN)/pytest -m 'hosts and not long' -rs tests/hosts \
		|| { echo 'failed; once more:'; $(AGAIN) -m 'hosts and not long' tests/hosts; }

# Such machines under drawn faults, round after round: LFA_ROUNDS of them (default 100, some 10 minutes).
test-campaign: $(STAMP)
	$(BIN)/pytest -m campaign -rs -s tests/hosts

# Every situation of shared/cases in which a team has to come through, in virtual time: some five minutes.
test-driving: $(STAMP)
	$(BIN)/pytest -m 'campaign or not campaign' -rs tests/deploy/scenarios/test_driving_cases.py \
		tests/deploy/scenarios/test_make_room.py

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy -p lfa.protocol -p lfa.agents -p lfa.world -p lfa.deploy -p tests.rigs
	$(BIN)/vulture

bench: $(STAMP)
	$(BIN)/lfa bench lidar

# The performance table of the documentation, from the benches; some rows of them: ROWS='router latency/kill*'
bench-table: $(STAMP)
	$(BIN)/python -m tests.bench_table $(ROWS)

# Half an hour of drawn faults on eight robots: nothing may grow, no invariant may fall. Shorter: MINUTES=2
soak: $(STAMP)
	$(BIN)/lfa bench soak --minutes $(or $(MINUTES),30)

# A thousand drawn schedules of faults on leases and gateways, systematic and guided ones, teams that lag, the fleet stop
# alone, and some on whole robots.
fuzz: $(STAMP)
	$(BIN)/lfa fuzz --seeds $(or $(SEEDS),1000) --jobs 2
	$(BIN)/lfa fuzz --systematic --seeds 300 --jobs 2
	$(BIN)/lfa fuzz --guided --seeds 100
	$(BIN)/lfa fuzz --lagging --seeds 300 --jobs 2
	$(BIN)/lfa fuzz --stops --seeds 2000 --jobs 2
	$(BIN)/lfa fuzz --whole --seeds 60 --jobs 2

# 100 000 schedules of the fleet stop alone, some fifty a second of one core, or SEEDS=5000 of them: operators, gateways and
# agents under faults, without leases. Done again are only those that the folder lacks; a share of them: SHARD=3/16
fuzz-stops: SCHEDULES = $(or $(SEEDS),100000)
fuzz-stops: $(STAMP)
	nice -n 15 $(BIN)/lfa fuzz --stops --seeds $(SCHEDULES) --jobs $(or $(JOBS),2) --out runs/fuzz-stops-$(SCHEDULES) \
		--shard $(or $(SHARD),1/1)

model: $(STAMP)
	$(BIN)/python -m tests.model

# Planted bugs: which invariant falls after how many schedules of faults; some ten minutes of one core. A share of them:
# PLANTED="--only 'rule E2'"; into the table of protocol/README.md: PLANTED=--write
planted: $(STAMP)
	$(BIN)/python -m tests.protocol.lease.hunt $(PLANTED)

# The same bugs against drawn, systematic and guided schedules, and schedules of the fleet stop alone, 1300 in all: half an
# hour and more of one core. Shares and --write as for make planted.
hunt: $(STAMP)
	nice -n 15 $(BIN)/python -m tests.protocol.lease.hunt --together $(PLANTED)

# Faults drawn from seeds: which of them does lfa why name? And of planted bugs: is the broken rule named? Some four minutes.
why: $(STAMP)
	$(BIN)/python -m tests.deploy.analysis.causes.drawn_faults
	$(BIN)/python -m tests.deploy.analysis.causes.planted_bugs

# The lines of agents, world and protocol that the fast tests of their rooms reach: a short form, for a traced Python takes
# three times as long. The floor is in pyproject.toml.
coverage: $(STAMP)
	$(BIN)/pytest -n 2 --dist load -m 'not processes' --cov=agents --cov=world --cov=protocol --cov-report=term \
		tests/agents tests/world tests/protocol/lease/traces tests/protocol/lease/test_[ghqv]*.py \
		tests/protocol/runtime tests/protocol/transport tests/protocol/messages tests/protocol/test_*.py

# Small faults put into one file, one at a time: which do the tests of its room miss? make mutants FILE=agents/navigator.py
mutants: $(STAMP)
	$(BIN)/python -m tests.mutation $(FILE)

# Does the code still behave as before? The first call records two runs of processes and writes a table of hashes of
# events and journal calls (all scenarios, 3 seeds, fuzz seeds, the two runs replayed); later calls compare with it. The
# first one compares a share of it, made twice. Each fails if a journal of the two runs returns otherwise than recorded.
# A share: SAME='--only straight leases'. Begin anew: rm -r runs/same
same: $(STAMP)
	PATH="$(abspath $(BIN)):$$PATH" tests/same.sh runs/same $(SAME)

# Tables from the code: a scenario's keys to the end of its page, the states and transitions of a lease into its page.
pages: $(STAMP)
	sed -i '/^| key | type /,$$d' world/SCENARIO.md
	$(BIN)/lfa schema --markdown >> world/SCENARIO.md
	$(BIN)/python -m tests.protocol.lease.page

# The pictures of the pages, made anew; needs chromium, xvfb, mesa-vulkan-drivers. Some of them: PICTURES='view web'
pictures: $(STAMP)
	rm -rf build/pictures
	$(BIN)/python -m tests.docs.pictures $(PICTURES)

# The documentation site in build/site, from the pages of the repository and its docstrings, and tests of what was built.
docs: $(STAMP) $(DOCS_STAMP)
	rm -rf build/pages build/site
	mkdir -p build/pages
	find $(PAGES) -name '*.md' -o -name '*.svg' -o -name '*.png' -o -name '*.gif' -o -name '*.css' -o -path '*/examples/*.py' -o -name 'grafana.json' \
	    | tar cf - -T - | tar xf - -C build/pages
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --config-file deploy/docs/mkdocs.yml
	LFA_SITE=build/site $(BIN)/pytest tests/docs/test_site.py

$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	touch $(DOCS_STAMP)

clean:
	rm -rf $(VENV) runs build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
