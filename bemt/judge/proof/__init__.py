"""The proof: truth that shares nothing with the solver, a stand that measures it, sealing and scoring.

Modules named ``truth*`` and ``stand`` make the data; they import nothing of the solver, its effects, its section data
or the diagnosis (a test of the layers holds them to it).
"""
