"""Twenty thousand damaged logs, and all bombs: the small copy of `benchmarks.fuzz`."""

import pytest

from benchmarks.fuzzing.bombs import BOMBS, read_bomb
from benchmarks.fuzzing.mutations import MUTATIONS
from benchmarks.fuzzing.seeds import seeds
from benchmarks.fuzzing.trials import HANG, mutant, run_batch

MUTANTS, BATCHES = 20_000, 8
SLOW = 5.0  # [s]; the benchmark holds them against one, on a machine that does nothing else


@pytest.mark.parametrize("part", range(BATCHES))
def test_no_damaged_log_raises_hangs_or_invents(part: int) -> None:
    count = MUTANTS // BATCHES
    batch = run_batch(20_261, part * count, count)
    failures = [(name, *one) for name, tally in batch.tallies.items() for one in tally.failures]
    assert failures == []
    assert sum(tally.mutants for tally in batch.tallies.values()) == count
    assert batch.slowest < HANG
    for seed in seeds():
        tally = batch.tallies[seed.name]
        assert tally.refused > 0.5 * tally.mutants  # the damage is felt
        assert tally.salvaged > 0.2 * tally.mutants  # and more than nothing is saved
        if seed.guard == "chunk":
            assert tally.strange == 0


def test_every_mutation_is_tried_and_is_the_same_again() -> None:
    tried = {name for k in range(600) for name in mutant(3, k)[1].split(" + ")}
    assert tried == set(MUTATIONS)
    assert mutant(3, 17) == mutant(3, 17)


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_costs_next_to_nothing(name: str) -> None:
    result = read_bomb(name)
    assert result.wrong == ""
    assert result.seconds < SLOW
