#!/usr/bin/env python3
"""Writes PyTorch checkpoints without PyTorch: CPython's own pickle and zipfile, with stand-ins for torch's names.

  torch_checkpoint.py IN.safetensors OUT.pt [state_dict | module | plain]   the tensors of a file, one at a time
  torch_checkpoint.py --corpus FOLDER                                       small files of every kind, hostile ones too
"""
import collections, io, json, os, pickle, struct, sys, types, zipfile

torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
sys.modules.update({"torch": torch, "torch._utils": utils})
STORAGES = {"F32": "Float", "F16": "Half", "BF16": "BFloat16", "F64": "Double", "I64": "Long", "U8": "Byte", "BOOL": "Bool"}
WIDTHS = {"F32": 4, "F16": 2, "BF16": 2, "F64": 8, "I64": 8, "U8": 1, "BOOL": 1}


def stand_in(module, name):
    def function(*_):
        raise RuntimeError("never called")
    function.__module__, function.__name__, function.__qualname__ = module.__name__, name, name
    setattr(module, name, function)
    return function


rebuild_tensor, rebuild_parameter = stand_in(utils, "_rebuild_tensor_v2"), stand_in(utils, "_rebuild_parameter")
for kind in STORAGES.values():
    setattr(torch, kind + "Storage", type(kind + "Storage", (), {"__module__": "torch"}))


class Size(tuple):
    def __reduce__(self):
        return (Size, (tuple(self),))


Size.__module__, Size.__qualname__, torch.Size = "torch", "Size", Size


class Storage:
    def __init__(self, key, dtype, numel):
        self.key, self.dtype, self.numel = key, dtype, numel


class Tensor:
    """`stride` None: row by row."""
    def __init__(self, storage, shape, stride=None, offset=0):
        self.storage, self.shape, self.offset, self.stride = storage, tuple(shape), offset, stride
        if stride is None:
            self.stride, step = (), 1
            for side in reversed(self.shape):
                self.stride, step = (step,) + self.stride, step * side

    def __reduce__(self):
        return (rebuild_tensor, (self.storage, self.offset, self.shape, self.stride, False, collections.OrderedDict()))


class Parameter(Tensor):
    def __reduce__(self):
        return (rebuild_parameter, (Tensor(self.storage, self.shape, self.stride, self.offset), True, collections.OrderedDict()))


class Pickler(pickle.Pickler):
    def persistent_id(self, thing):
        if isinstance(thing, Storage):
            return ("storage", getattr(torch, STORAGES[thing.dtype] + "Storage"), thing.key, "cpu", thing.numel)
        return None


def pickled(thing):
    out = io.BytesIO()
    Pickler(out, protocol=2).dump(thing)
    return out.getvalue()


def in_layout(state, layout):
    state = collections.OrderedDict(state)
    state._metadata = collections.OrderedDict({"": {"version": 1}})
    if layout == "state_dict":
        return {"epoch": 3, "global_step": 2**40, "pytorch-lightning_version": "1.9.3", "state_dict": state, "loops": None,
                "callbacks": {"best": {"score": 0.25, "paths": ["a", "b"], "on": True}}, "lr_schedulers": []}
    if layout == "module":
        state = collections.OrderedDict(("_forward_module." + key, value) for key, value in state.items())
        return {"module": state, "buffer_names": ["betas"], "param_shapes": [{"w": Size((2, 3))}], "skipped": set(), "dp_world_size": 8}
    return state


def write(path, thing, storages, pickle_bytes=None, **zip_options):
    """@param storages  {key: bytes or a function that writes to a file}"""
    def entry(name):
        info = zipfile.ZipInfo("archive/" + name)  # of 1980: the same bytes every time
        info.compress_type = zip_options.get("compression", zipfile.ZIP_STORED)
        return info

    with zipfile.ZipFile(path, "w", **zip_options) as archive:
        archive.writestr(entry("data.pkl"), pickle_bytes if pickle_bytes is not None else pickled(thing))
        archive.writestr(entry("byteorder"), "little")
        for key, data in storages.items():
            if callable(data):
                info = entry("data/" + key)
                padding = -(archive.fp.tell() + 30 + len(info.filename) + 4 + 20) % 64  # as torch.save: every storage at 64 bytes
                info.extra = b"FB" + struct.pack("<H", padding) + bytes(padding)
                with archive.open(info, "w", force_zip64=True) as out:
                    data(out)
            else:
                archive.writestr(entry("data/" + key), data)
        archive.writestr(entry("version"), "3\n")


def convert(source, target, layout):
    with open(source, "rb") as file:
        start = 8 + struct.unpack("<Q", file.read(8))[0]
        header = json.loads(file.read(start - 8))
        header.pop("__metadata__", None)
        state, storages = {}, {}
        for i, (name, entry) in enumerate(header.items()):
            begin, end = entry["data_offsets"]
            storages[str(i)] = lambda out, begin=begin, end=end: copy(file, start + begin, end - begin, out)
            state[name] = Tensor(Storage(str(i), entry["dtype"], (end - begin) // WIDTHS[entry["dtype"]]), entry["shape"])
        write(target, in_layout(state, layout), storages)


def copy(file, at, count, out):
    file.seek(at)
    while count > 0:
        piece = file.read(min(count, 1 << 24))
        out.write(piece)
        count -= len(piece)


class Hostile:
    def __reduce__(self):
        return (os.system, ("touch /tmp/evac_was_executed",))


def corpus(folder):
    numbers = struct.pack("<24f", *range(24))
    whole = Storage("0", "F32", 24)
    halves = Storage("1", "BF16", 4)
    state = {"w": Tensor(whole, (4, 6)), "part": Tensor(whole, (2, 3), offset=18), "turned": Tensor(whole, (6, 4), (1, 6)),
             "halves": Tensor(halves, (4,)), "one": Parameter(whole, (), offset=5), "none": Tensor(whole, (0, 3))}
    storages = {"0": numbers, "1": bytes(8)}
    for layout in ("state_dict", "module", "plain"):
        write(f"{folder}/{layout}", in_layout(state, layout), storages)
        with open(f"{folder}/{layout}_pickle", "wb") as out:
            out.write(pickled(in_layout(state, layout)))
    bad = {"hostile": ({"w": Hostile()}, storages), "beyond": ({"w": Tensor(whole, (5, 6))}, storages),
           "repeated": ({"w": Tensor(whole, (1000, 1000, 1000), (0, 0, 0))}, storages),
           "lost": ({"w": Tensor(whole, (4, 6))}, {}), "short": ({"w": Tensor(whole, (4, 6))}, {"0": numbers[:-4]}),
           "nested": ({"model": {"w": Tensor(whole, (4, 6))}}, storages), "list": ([1, 2], storages)}
    for name, (thing, data) in bad.items():
        write(f"{folder}/{name}", thing, data)
    write(f"{folder}/protocol4", None, storages, pickle_bytes=pickle.dumps({"w": 1}, protocol=4))
    write(f"{folder}/compressed", in_layout(state, "plain"), storages, compression=zipfile.ZIP_DEFLATED)
    with open(f"{folder}/legacy", "wb") as out:
        pickle.dump(0x1950A86A20F9469CFC6C, out, protocol=2)


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "--corpus":
        corpus(sys.argv[2])
    elif len(sys.argv) in (3, 4):
        convert(sys.argv[1], sys.argv[2], sys.argv[3] if len(sys.argv) == 4 else "plain")
    else:
        sys.exit(__doc__)
