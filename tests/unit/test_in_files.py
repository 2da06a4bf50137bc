"""Whole files to the workers, in their order, and not more than two of `tests/system` at a time."""

from __future__ import annotations

from types import SimpleNamespace

from support.in_files import InFiles

FILES = {
    "tests/system/page/test_a.py": 3,
    "tests/system/page/test_b.py": 3,
    "tests/system/test_c.py": 4,
    "tests/system/test_d.py": 4,
    "tests/unit/test_e.py": 9,
    "tests/unit/test_f.py": 5,
    "tests/unit/test_g.py": 5,
}
COLLECTION = [f"{file}::test_{number}" for file, count in FILES.items() for number in range(count)]


class Worker:
    """Takes what it is given."""

    shutting_down = False

    def __init__(self) -> None:
        self.waiting: list[int] = []
        self.gateway = SimpleNamespace(id="gw")

    def send_runtest_some(self, numbers: list[int]) -> None:
        self.waiting += numbers

    def shutdown(self) -> None:
        self.shutting_down = True

    def file(self) -> str:
        """Where it is."""
        return COLLECTION[self.waiting[0]].partition("::")[0]


def begun(count: int) -> tuple[InFiles, list[Worker]]:
    options = SimpleNamespace(loadscopereorder=True)
    made = InFiles(SimpleNamespace(getvalue=lambda _: ["popen"] * count, option=options))
    workers = [Worker() for _ in range(count)]
    for worker in workers:
        made.add_node(worker)
    for worker in workers:
        made.add_node_collection(worker, COLLECTION)
    made.schedule()
    return made, workers


def test_a_file_and_a_folder_with_a_service_go_to_one_worker_and_every_test_runs_once() -> None:
    made, workers = begun(3)
    ran: dict[str, set[int]] = {file: set() for file in FILES}
    seen = []
    while any(worker.waiting for worker in workers):
        waits = {worker.file() for worker in workers if worker.waiting}
        assert sum(file.startswith("tests/system/") for file in waits) <= 2
        for number, worker in enumerate(workers):
            if worker.waiting:
                ran[worker.file()].add(number)
                seen.append(worker.waiting[0])
                made.mark_test_complete(worker, worker.waiting.pop(0))
    assert sorted(seen) == list(range(len(COLLECTION)))
    assert all(len(numbers) == 1 for numbers in ran.values())
    assert ran["tests/system/page/test_a.py"] == ran["tests/system/page/test_b.py"]
    assert all(worker.shutting_down for worker in workers)
    assert made.tests_finished


def test_the_first_files_begin_first_and_a_third_worker_computes() -> None:
    _, workers = begun(3)
    assert [worker.file() for worker in workers] == [
        "tests/system/page/test_a.py", "tests/system/test_c.py", "tests/unit/test_e.py",
    ]  # fmt: skip


def test_a_worker_that_dies_leaves_its_files_to_the_others() -> None:
    made, (first, second) = begun(2)
    died_at = COLLECTION[first.waiting[0]]
    assert made.remove_node(first) == died_at
    left = set(first.waiting) | set(second.waiting)
    while second.waiting:
        left.discard(second.waiting[0])
        made.mark_test_complete(second, second.waiting.pop(0))
    assert not left
