"""`jacokin warmup`."""

from __future__ import annotations

import pytest

from jacokin.errors import JacokinError
from jacokin.kernels.compiled import loading
from jacokin.kernels.compiled.loading import Kernels
from tests.cli.run import Run


def test_it_says_that_the_closed_form_is_ready(run: Run) -> None:
    answer = run("warmup")
    assert answer.code == 0
    assert answer.out.startswith("the closed form is ready (")
    assert run("warmup").err == ""


def test_it_does_not_claim_to_have_compiled_when_numba_is_disabled(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "KERNELS", Kernels())
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    answer = run("warmup")
    assert answer.code == 1
    assert answer.out == ""
    assert "jacokin: NUMBA_DISABLE_JIT is set" in answer.err


def test_a_compiler_that_fails_is_one_sentence(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        def warmup(self) -> None:
            raise JacokinError("the closed form could not be compiled: no numba")

    monkeypatch.setattr(loading, "KERNELS", Broken())
    answer = run("warmup")
    assert answer.code == 2
    assert answer.err == "jacokin: the closed form could not be compiled: no numba\n"
