"""Cases: `load` reads them, `schema` and `rules` say what a file may hold, `build` makes rotor, duct and air of it."""

from bemt.rotors.case.load import Assumption, Case, case_of, check_name, find_cases, load_case, repeated_names

__all__ = ["Assumption", "Case", "case_of", "check_name", "find_cases", "load_case", "repeated_names"]
