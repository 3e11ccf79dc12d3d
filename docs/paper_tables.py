#!/usr/bin/env python3
"""Published tables of real and simulated success rates through `evac correlate --pairs`.

docs/paper_tables.py TABLES.json EVAC [FOLDER]: prints the table of docs/paper_tables.md; leaves rates.csv in FOLDER.
"""

import csv
import json
import pathlib
import subprocess
import sys
import tempfile


def write_csv(tables, path):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["group", "task", "policy", "real_sr", "sim_sr"])
        for table in tables:
            for row in table["rows"]:
                group = f'{table["id"]}/{row.get("group", "all")}'
                writer.writerow([group, row.get("task", ""), row["policy"], row["real_sr"], row["sim_sr"]])


def shown(value):
    return "–" if value is None else f"{value:.3f}"


def with_interval(group, key):
    interval = group.get(key + "_ci95")
    return shown(group[key]) + (f" [{interval[0]:.2f}, {interval[1]:.2f}]" if interval else "")


def main():
    tables = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))["datasets"]
    folder = pathlib.Path(sys.argv[3] if len(sys.argv) > 3 else tempfile.mkdtemp())
    write_csv(tables, folder / "rates.csv")
    words = [sys.argv[2], "correlate", "--pairs", str(folder / "rates.csv"), "--json"]
    answer = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    groups = {group["group"]: group for group in answer["groups"]}
    print("| data set | n | Pearson published | Pearson [95 %] | Spearman | MMRV published | MMRV |\n|---|---|---|---|---|---|---|")
    for table in tables:
        for name in table["recomputed_by_us"]:
            group = groups[f'{table["id"]}/{name}']
            published = table["published"].get(name, {})
            print(f'| {table["id"]} / {name} | {group["n"]} | {shown(published.get("pearson"))} | {with_interval(group, "pearson")}'
                  f' | {shown(group["spearman"])} | {shown(published.get("mmrv"))} | {shown(group["mmrv"])} |')


if __name__ == "__main__":
    main()
