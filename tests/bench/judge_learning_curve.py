#!/usr/bin/env python3
"""How many labels a lab's own classifier judge needs: judge_learning_curve.py LABELLED TEST OUT [--seeds 5] [--labels 50,100,200]

    evac run tests/bench/judge_learning_curve.yaml --out out/labelled --set 'initial_states={seed: 77, count: 52}'
    evac run tests/bench/judge_learning_curve.yaml --out out/test --set 'initial_states={seed: 41, count: 12}'
    tests/bench/judge_learning_curve.py out/labelled out/test out/curve

For each seed and number of labels per task: so many clips of LABELLED's real world, drawn at random, keep the oracle's label, 5 % of
them the wrong one; `evac judge train` learns from them; its kappa with the oracle is measured on all clips of TEST, whose initial states
it never saw, world by world. Writes OUT/curve.csv, a row as it is known, and OUT/curve.svg; what is in the CSV already is not done again.
"""
import argparse
import csv
import json
import os
import pathlib
import random
import shutil
import sqlite3
import subprocess
import sys

WRONG = 0.05
FIELDS = ["seed", "labels_per_task", "world", "n", "kappa", "steps"]


def run(evac, *words):
    done = subprocess.run([evac, *map(str, words)], capture_output=True, text=True)
    if done.returncode not in (0, 1, 3):
        sys.exit(f"{' '.join(map(str, words))}: {done.stderr[-2000:]}")
    return done.stdout


def copy_of(source, folder):
    """A run of its own that shares the other's clips."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with sqlite3.connect(source / "evac.sqlite") as old, sqlite3.connect(folder / "evac.sqlite") as new:
        old.backup(new)
    for name in ("videos", "thumbs"):
        os.symlink((source / name).resolve(), folder / name)
    return folder


def label(folder, seed, per_task):
    """@returns the judge whose verdicts are the lab's."""
    chance, judge = random.Random(f"{seed}/{per_task}"), f"human:lab-{seed}-{per_task}"
    with sqlite3.connect(folder / "evac.sqlite") as store:
        rows = store.execute(
            "SELECT e.task, v.episode, v.label, v.stages, v.rubric_version FROM verdicts v JOIN episodes e ON e.id = v.episode "
            "JOIN worlds w ON w.name = e.world WHERE v.judge = 'oracle' AND w.is_real = 1 AND v.label IN ('success', 'failure') "
            "ORDER BY v.episode").fetchall()
        for task in sorted({row[0] for row in rows}):
            of_task = [row for row in rows if row[0] == task]
            if len(of_task) < per_task:
                sys.exit(f"{folder}: task {task} has {len(of_task)} labels, wanted {per_task}")
            drawn = chance.sample(of_task, per_task)
            wrong = set(chance.sample(range(per_task), round(WRONG * per_task)))
            for i, (_, episode, said, stages, rubric) in enumerate(drawn):
                if i in wrong:
                    said = "failure" if said == "success" else "success"
                store.execute("INSERT INTO verdicts (episode, judge, label, stages, reason, rubric_version) VALUES (?, ?, ?, ?, ?, ?)",
                              (episode, judge, said, stages, "a lab's label", rubric))
    return judge


def kappas(evac, weights, test, scratch):
    """World -> (n, kappa with the oracle)."""
    judged = copy_of(test, scratch / "judged")
    run(evac, "judge", judged, "--judge", "classifier", "--weights", weights)
    told = json.loads(run(evac, "ls", judged, "--json"))
    by_world = {}
    for episode in told:
        verdicts = {judge.split(":")[0]: said for judge, said in episode["verdicts"].items()}
        pair = verdicts.get("classifier"), verdicts.get("oracle")
        if all(said in ("success", "failure") for said in pair):
            by_world.setdefault(episode["world"], []).append(pair)
    result = {}
    for world, pairs in by_world.items():
        n, same = len(pairs), sum(a == b for a, b in pairs) / len(pairs)
        a, b = (sum(pair[k] == "success" for pair in pairs) / n for k in (0, 1))
        by_chance = a * b + (1 - a) * (1 - b)
        result[world] = (n, (same - by_chance) / (1 - by_chance))
    return result


def draw(rows, path):
    counts = sorted({int(row["labels_per_task"]) for row in rows})
    width, height, left, top, bottom = 560, 320, 60, 34, 46
    x = lambda labels: left + (width - left - 40) * (counts.index(labels) + 0.5) / len(counts)
    y = lambda kappa: height - bottom - max(0.0, kappa) * (height - top - bottom)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">',
           f'<rect width="{width}" height="{height}" fill="white"/>',
           f'<text x="{left}" y="20">Kappa with the oracle on initial states never seen, a dot per seed</text>']
    for kappa in (0, 0.2, 0.4, 0.6, 0.8, 1):
        out.append(f'<line x1="{left}" x2="{width - 40}" y1="{y(kappa):.1f}" y2="{y(kappa):.1f}" stroke="{"#1a1e23" if kappa == 0.8 else "#dcdfe4"}" '
                   f'stroke-dasharray="{"4 3" if kappa == 0.8 else "none"}"/><text x="{left - 8}" y="{y(kappa) + 4:.1f}" text-anchor="end">{kappa:g}</text>')
    for k, (world, colour, sign) in enumerate((("real", "#1b6ca8", "circle"), ("sim", "#c2571a", "rect"))):
        means = []
        for labels in counts:
            values = [float(row["kappa"]) for row in rows if row["world"] == world and int(row["labels_per_task"]) == labels]
            at = x(labels) + (k - 0.5) * 18
            for value in values:
                out.append(f'<circle cx="{at:.1f}" cy="{y(value):.1f}" r="3.5" fill="none" stroke="{colour}" stroke-width="1.5"/>' if sign == "circle" else
                           f'<rect x="{at - 3:.1f}" y="{y(value) - 3:.1f}" width="6" height="6" fill="none" stroke="{colour}" stroke-width="1.5"/>')
            if values:
                means.append((at, y(sum(values) / len(values))))
        out.append(f'<polyline points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in means)}" fill="none" stroke="{colour}" stroke-width="2"/>')
        if means:
            out.append(f'<text x="{means[-1][0] + (10 if k else 28):.1f}" y="{means[-1][1] + (18 if k else -8):.1f}" fill="{colour}">{world}</text>')
    for labels in counts:
        out.append(f'<text x="{x(labels):.1f}" y="{height - bottom + 18}" text-anchor="middle">{labels}</text>')
    out.append(f'<text x="{(left + width - 40) / 2:.0f}" y="{height - 8}" text-anchor="middle">labels per task, {WRONG:.0%} of them wrong</text></svg>')
    path.write_text("\n".join(out) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("labelled", type=pathlib.Path)
    parser.add_argument("test", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--evac", default="build/release/bin/evac")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--labels", default="50,100,200")
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--holdout", type=float, default=0.1, help="of the labelled states; TEST tells what the judge is worth")
    parser.add_argument("--training", default="apps/configs/desk_training.yaml")
    parser.add_argument("--set", action="append", default=[], metavar="OPTION=VALUE", help="of the judge's training")
    a = parser.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    path = a.out / "curve.csv"
    rows = list(csv.DictReader(path.open())) if path.exists() else []
    known = {(row["seed"], row["labels_per_task"]) for row in rows}
    for labels in map(int, a.labels.split(",")):
        for seed in range(1, a.seeds + 1):
            if (str(seed), str(labels)) in known:
                continue
            scratch = a.out / f"scratch-{seed}-{labels}"
            judge = label(copy_of(a.labelled, scratch / "labelled"), seed, labels)
            run(a.evac, "judge", "train", scratch / "labelled", "--truth", judge, "--training", a.training, "--steps", a.steps,
                "--set", f"seed={seed}", *(word for pair in a.set for word in ("--set", pair)), "--least", 5,
                "--holdout", a.holdout, "--out", scratch / "judge")
            for world, (n, kappa) in kappas(a.evac, scratch / "judge" / "judge.safetensors", a.test, scratch).items():
                rows.append({"seed": seed, "labels_per_task": labels, "world": world, "n": n, "kappa": f"{kappa:.4f}", "steps": a.steps})
                print(f"seed {seed}, {labels} labels a task, {world}: kappa {kappa:.3f} of {n}", flush=True)
            shutil.rmtree(scratch)
            with path.open("w", newline="") as file:
                table = csv.DictWriter(file, FIELDS, lineterminator="\n")
                table.writeheader()
                table.writerows(rows)
            draw(rows, a.out / "curve.svg")


if __name__ == "__main__":
    main()
