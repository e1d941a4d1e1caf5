"""Everything that makes a table or a figure: collect, train, evaluate, report."""
