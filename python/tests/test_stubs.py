# SPDX-License-Identifier: BSD-2-Clause
"""The type stubs name what the module has."""
import ast
import inspect
import pathlib

import pmsp
from conftest import SOURCE

STUBS = ast.parse((SOURCE / "python/pmsp/__init__.pyi").read_text())


def stub_members(nodes):
    """Names of the stubs: a class, or whether it may be assigned."""
    members = {}
    for node in nodes:
        if isinstance(node, ast.ClassDef):
            members[node.name] = node
        elif isinstance(node, ast.FunctionDef):
            is_property = any(getattr(each, "id", "") == "property" for each in node.decorator_list)
            is_setter = any(getattr(each, "attr", "") == "setter" for each in node.decorator_list)
            members[node.name] = "attribute" if is_setter else "read-only" if is_property else "function"
        elif isinstance(node, ast.AnnAssign):
            kind = getattr(getattr(node.annotation, "value", None), "id", "")
            members[node.target.id] = {"Final": "read-only", "ClassVar": "class"}.get(kind, "attribute")
    return {name: kind for name, kind in members.items() if not name.startswith("_")}


def module_members(scope):
    members = {}
    for name, value in vars(scope).items():
        if inspect.isclass(value):
            members[name] = value
        elif isinstance(value, property):
            members[name] = "read-only" if value.fset is None else "attribute"
        elif callable(value) or isinstance(value, (staticmethod, classmethod)):
            members[name] = "function"
        elif not inspect.ismodule(value):
            members[name] = "class" if inspect.isclass(scope) else "attribute"
    return {name: kind for name, kind in members.items() if not name.startswith("_")}


def compare(where, stubs, members):
    assert set(stubs) == set(members), where
    for name, kind in stubs.items():
        if isinstance(kind, ast.ClassDef):
            enumerators = getattr(members[name], "__members__", None)
            inner = dict.fromkeys(enumerators, "class") if enumerators else module_members(members[name])
            compare(f"{where}.{name}", stub_members(kind.body), inner)
        else:
            assert kind == members[name], f"{where}.{name}"


def test_the_stubs_name_all_members_and_which_can_be_assigned():
    compare("pmsp", stub_members(STUBS.body), module_members(pmsp))


def test_the_stubs_are_installed():
    installed = pathlib.Path(pmsp.__file__).parent
    assert (installed / "__init__.pyi").read_bytes() == (SOURCE / "python/pmsp/__init__.pyi").read_bytes()
    assert (installed / "py.typed").exists()
