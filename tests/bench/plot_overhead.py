#!/usr/bin/env python3
"""Draws the overhead per chunk against lanes, one line per number of views, from a benchmark's JSON:

    ./run bench --benchmark_filter=OverheadPerChunk --benchmark_out=overhead.json --benchmark_out_format=json
    tests/bench/plot_overhead.py overhead.json docs/images/overhead.svg
"""
import json
import re
import sys

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 640, 360, 60, 90, 30, 50
COLOURS = {1: "#1b6ca8", 2: "#c2571a", 3: "#2e7d32"}


def points_of(path):
    """views -> [(lanes, median ms, p95 ms)]"""
    lines = {}
    for run in json.load(open(path))["benchmarks"]:
        found = re.match(r"OverheadPerChunk/lanes:(\d+)/views:(\d+)", run["name"])
        if found:
            lanes, views = map(int, found.groups())
            lines.setdefault(views, []).append((lanes, run["median_ms_per_chunk"], run["p95_ms_per_chunk"]))
    if not lines:
        sys.exit(f"{path}: holds no OverheadPerChunk, wanted a run with --benchmark_filter=OverheadPerChunk")
    return {views: sorted(points) for views, points in sorted(lines.items())}


def draw(lines):
    lanes = sorted({point[0] for points in lines.values() for point in points})
    top = max(30.0, 1.1 * max(point[1] for points in lines.values() for point in points))

    def x(lane):
        return LEFT + lanes.index(lane) * (WIDTH - LEFT - RIGHT) / max(1, len(lanes) - 1)

    def y(ms):
        return HEIGHT - BOTTOM - ms / top * (HEIGHT - TOP - BOTTOM)

    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13">',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
           f'<text x="{LEFT}" y="18">Overhead of the harness per chunk, median, ms (views of 320x512)</text>']
    step = 5 if top < 60 else 20
    for ms in range(0, int(top) + 1, step):
        out.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(ms):.1f}" y2="{y(ms):.1f}" stroke="#ddd"/>'
                   f'<text x="{LEFT - 8}" y="{y(ms) + 4:.1f}" text-anchor="end" fill="#555">{ms}</text>')
    for lane in lanes:
        out.append(f'<text x="{x(lane):.1f}" y="{HEIGHT - BOTTOM + 20}" text-anchor="middle" fill="#555">{lane}</text>')
    out.append(f'<text x="{(WIDTH + LEFT - RIGHT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">lanes</text>')
    out.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(25):.1f}" y2="{y(25):.1f}" stroke="#999" stroke-dasharray="5 4"/>'
               f'<text x="{WIDTH - RIGHT + 6}" y="{y(25) + 4:.1f}" fill="#777">25 ms</text>')
    for views, points in lines.items():
        colour = COLOURS.get(views, "#444")
        path = " ".join(f"{x(lane):.1f},{y(ms):.1f}" for lane, ms, _ in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        out += [f'<circle cx="{x(lane):.1f}" cy="{y(ms):.1f}" r="3.5" fill="{colour}"/>' for lane, ms, _ in points]
        lane, ms, _ = points[-1]
        out.append(f'<text x="{x(lane) + 8:.1f}" y="{y(ms) + 4:.1f}" fill="{colour}">{views} view{"s" if views > 1 else ""}</text>')
    return "\n".join(out + ["</svg>", ""])


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    open(sys.argv[2], "w").write(draw(points_of(sys.argv[1])))
