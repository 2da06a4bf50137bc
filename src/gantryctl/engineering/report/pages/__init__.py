"""Reports on what no other part of engineering makes: a brake test, a recording."""
