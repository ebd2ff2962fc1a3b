"""The modules import each other one way only: whoever reads one never comes back to it."""

from __future__ import annotations

from graphlib import TopologicalSorter

import grimp


def test_no_module_imports_itself_by_way_of_others_not_even_for_its_types():
    graph = grimp.build_graph("mpc_cover", "solvers", exclude_type_checking_imports=False, cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    TopologicalSorter(imports).prepare()  # a CycleError names the modules of a cycle
