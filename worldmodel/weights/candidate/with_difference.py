#!/usr/bin/env python3
"""The bf16 weights that are the shipped ones plus a difference: with_difference.py OLD.safetensors DELTA.xz NEW.safetensors

DELTA.xz: the new file's header, then for every tensor's bf16 codes the difference from the old file's, low bytes, then
high bytes. With --make: NEW is read and DELTA.xz is written."""
import array, hashlib, json, lzma, struct, sys

def parts(path):
    data = open(path, 'rb').read()
    n = struct.unpack('<Q', data[:8])[0]
    return data[:8 + n], data[8 + n:]

def keys(header):
    table = json.loads(header[8:])
    return {k: (v['dtype'], v['data_offsets']) for k, v in table.items() if k != '__metadata__'}

def codes(raw):
    numbers = array.array('H'); numbers.frombytes(raw)
    return numbers

def main():
    make = '--make' in sys.argv
    old_path, delta_path, new_path = [a for a in sys.argv[1:] if a != '--make']
    old_header, old = parts(old_path)
    table = keys(old_header)
    if make:
        header, new = parts(new_path)
        low, high = bytearray(), bytearray()
        for key, (kind, (a, b)) in sorted(keys(header).items()):
            was = old[slice(*table[key][1])]
            for x, y in zip(codes(new[a:b]), codes(was)):
                d = (x - y + 0x8000) & 0xffff
                low.append(d & 255); high.append(d >> 8)
        open(delta_path, 'wb').write(lzma.compress(header + bytes(low) + bytes(high), preset=6))
        return
    packed = lzma.decompress(open(delta_path, 'rb').read())
    n = 8 + struct.unpack('<Q', packed[:8])[0]
    header, rest = packed[:n], packed[n:]
    half = len(rest) // 2
    new = bytearray(2 * half); at = 0
    for key, (kind, (a, b)) in sorted(keys(header).items()):
        was = codes(old[slice(*table[key][1])])
        out = array.array('H', bytes(b - a))
        for i, y in enumerate(was):
            out[i] = (rest[at + i] + 256 * rest[half + at + i] - 0x8000 + y) & 0xffff
        at += len(was)
        new[a:b] = out.tobytes()
    open(new_path, 'wb').write(header + bytes(new))
    print(hashlib.sha256(header + bytes(new)).hexdigest())

main()
