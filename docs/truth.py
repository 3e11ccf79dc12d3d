#!/usr/bin/env python3
"""The tables of docs/truth.md, from what `evac fidelity` wrote.

docs/truth.py NAME=FIDELITY.json ...: one column per file, beside what is wanted. A number that misses it is in bold type.
"""

import json
import pathlib
import sys


def at(answer, *path):
    """What lies there; None where that part was not asked for or is undefined."""
    for key in path:
        answer = answer.get(key) if isinstance(answer, dict) else None
    return answer


def real_rates_between(answer, low, high):
    return sum(low <= cell["real_sr"] <= high for cell in answer["cells"] if cell["real_sr"] is not None)


def least_gain_db(part):
    """Over the frozen first picture, of the pixels that move, in the worst chunk in which some do."""
    pairs = zip(at(part, "psnr_moving_by_chunk") or [], at(part, "psnr_moving_copy_by_chunk") or [])
    return min((imagined - copied for imagined, copied in pairs if None not in (imagined, copied)), default=None)


def rows(answers):
    """(what, its value in an answer, the limit in an answer, whether at least or at most)."""
    fixed = lambda limit: lambda answer: limit
    like_reality = lambda key, more: lambda answer: None if at(answer, key + "_real_real") is None else at(answer, key + "_real_real") + more
    yield "cells", lambda a: len(a["cells"]), fixed(24), ">="
    yield "of a real rate of .20 to .80", lambda a: real_rates_between(a, .2, .8), fixed(12), ">="
    yield "fewest pairs of a cell that the judge could tell", lambda a: min((cell["n"] for cell in a["cells"]), default=None), fixed(None), ">="
    yield "agreement, real and real", lambda a: at(a, "agreement_real_real"), fixed(.9), ">="
    yield "Pearson", lambda a: at(a, "pearson"), fixed(.95), ">="
    yield "its lower 95 % bound", lambda a: at(a, "pearson_low"), fixed(.85), ">="
    yield "MMRV", lambda a: at(a, "mmrv"), like_reality("mmrv", .02), "<="
    yield "agreement", lambda a: at(a, "agreement"), like_reality("agreement", -.05), ">="
    yield "hallucinated", lambda a: at(a, "hallucinated"), like_reality("hallucinated", .05), "<="
    yield "missed", lambda a: at(a, "missed"), like_reality("missed", .05), "<="
    yield "open loop: agreement", lambda a: at(a, "open_loop", "agreement"), fixed(.9), ">="
    yield "open loop: hallucinated", lambda a: at(a, "open_loop", "hallucinated"), fixed(.05), "<="
    yield "open loop: object, px at 85 %", lambda a: at(a, "open_loop", "object_px_error_p85"), fixed(6), "<="
    for what in ("agreement", "hallucinated", "missed"):
        yield f"executed: {what}", lambda a, what=what: at(a, "executed", what), fixed(None), ">="
    for kind in dict.fromkeys(one["kind"] for answer in answers for one in answer["counterfactual"]):
        of_kind = lambda a, kind=kind: next((one["hallucinated"] for one in a["counterfactual"] if one["kind"] == kind), None)
        yield f"counterfactual: {kind.replace('_', ' ')}", of_kind, fixed(.05), "<="
    yield "30 chunks: least gain over the copy, dB", lambda a: least_gain_db(at(a, "horizon")), fixed(2), ">="
    yield "seconds per chunk", lambda a: at(a, "seconds_per_chunk"), fixed(.3), "<="
    yield "judge on real clips: AUROC", lambda a: at(a, "judge", "auroc"), fixed(.98), ">="
    yield "its kappa", lambda a: at(a, "judge", "kappa"), fixed(.85), ">="
    yield "its kappa with the object painted over", lambda a: at(a, "judge", "kappa_masked"), fixed(None), "<="
    yield "its ECE", lambda a: at(a, "judge", "ece"), fixed(.05), "<="


def shown(value):
    return "–" if value is None else str(value) if isinstance(value, int) else f"{value:.3f}"


def judged(value, limit, sense):
    if value is None or limit is None:
        return shown(value)
    return shown(value) if (value >= limit if sense == ">=" else value <= limit) else f"**{shown(value)}**"


def wanted(limits, sense):
    """One limit where all answers have the same, else the range: reality differs from states to states."""
    known = sorted({shown(limit) for limit in limits if limit is not None})
    return f"{'≥' if sense == '>=' else '≤'} {' … '.join(dict.fromkeys((known[0], known[-1])))}" if known else "–"


def main():
    if len(sys.argv) < 2 or any("=" not in word for word in sys.argv[1:]):
        sys.exit(__doc__)
    names, files = zip(*(word.split("=", 1) for word in sys.argv[1:]))
    answers = [json.loads(pathlib.Path(file).read_text(encoding="utf-8")) for file in files]
    print(f"| | wanted | {' | '.join(names)} |\n|---|---|{'---|' * len(names)}")
    for what, value, limit, sense in rows(answers):
        limits = [limit(answer) for answer in answers]
        cells = [judged(value(answer), bound, sense) for answer, bound in zip(answers, limits)]
        print(f"| {what} | {wanted(limits, sense)} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
