# Writes the dependences between sources for make: `x.o: y.mod` for every `use y` in x.f90 or x.pf, `x.o: y.o` for a
# submodule x of y, and the list of objects that do not require HDF5. Objects of src/ are in one folder, all others in
# another.
# usage: awk -v build=FOLDER -v tests=FOLDER -f src/modules.awk FILE...
FNR == 1 {
  me = FILENAME
  gsub(/.*\/|\.[a-z0-9]*$/, "", me)
  home[me] = (FILENAME ~ /^src\// ? build : tests) "/" me
}
tolower($1) == "use" {
  sub(/,.*/, "", $2)
  uses[me " " $2]
}
tolower($1) ~ /^submodule/ {
  gsub(/.*\(|\).*/, "")
  uses[me " " $0]
  parts[me " " $0]
}
END {
  home["build_info"] = build "/build_info"
  needs["hdf5"]
  do {
    grown = 0
    for (pair in uses) {
      split(pair, name, " ")
      if (name[2] in needs && !(name[1] in needs)) {
        needs[name[1]]
        grown = 1
      }
    }
  } while (grown)
  for (pair in uses) {
    split(pair, name, " ")
    if (name[2] in home && name[1] != name[2]) print home[name[1]] ".o: " home[name[2]] (pair in parts ? ".o" : ".mod")
  }
  for (me in home)
    if (!(me in needs) && home[me] == build "/" me) print "without_hdf5 += " build "/" me ".o"
}
