# Doxygen's filter of headers. A comment of the outermost level describes the file if an empty line or the beginning of
# namespace doppel follows it: then the empty line before it becomes "/// @file". The number of lines stays.
function flush_comment(is_of_file) {
  if (after_empty_line) print is_of_file ? "/// @file" : ""
  printf "%s", comment
  after_empty_line = 0
  comment = ""
}
/^\/\/\// { comment = comment $0 "\n"; next }
{
  flush_comment(comment != "" && ($0 == "" || $0 == "namespace doppel {"))
  if ($0 == "") after_empty_line = 1
  else print
}
END { flush_comment(0) }
