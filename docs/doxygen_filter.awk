# Marks the comments of a public header for Doxygen; from the declarations on, line numbers stay the same.
#   //  at the top of the file         becomes the file's description, that of halfshade.h the main page
#   code;  // text                     becomes code;  ///< text, together with the comment lines below it
#   two declarations in one line       become two, each with the line's comment
# Nothing else changes: comments inside function bodies keep their slashes. In the C header, likewise with /* text */.

BEGIN { at_top = 1; follows = 0 }

FNR == 1 { in_c = /^\/\*/ }
in_c {
  if (FNR == 1) sub(/^\/\*/, "/** @file\n *")
  else if (/^#define HALFSHADE_[A-Z_]*_H$/) next  # makes up for it
  else if (/^ *\/\* / && !/^\/\* ----/) sub(/\/\* /, "/** ")
  else if (/[;,] +\/\* /) sub(/\/\* /, "/**< ")
  else if (/[0-9] +\/\* /) sub(/\/\* /, "/**< ")
  print
  next
}

FNR == 1 && /^\/\// {
  print (FILENAME ~ /\/halfshade\.h$/ ? "/// @mainpage The interface of halfshade" : "/// @file")
}
at_top && /^\/\// {
  text = substr($0, 3)
  # Lines with a first column, such as "Space   right-handed", start a paragraph of their own.
  if (match(text, /^ [A-Z][A-Za-z]*  +/)) {
    name = substr(text, 2, RLENGTH - 1)
    sub(/ +$/, "", name)
    print "/// @par " name "^^" substr(text, RLENGTH + 1)
    next
  }
  if (FILENAME ~ /\/halfshade\.h$/) sub(/^ +/, " ", text)
  print "///" text
  next
}
/^#pragma once/ { at_top = 0; next }  # its line went to the one added above

# Comparison member by member and moving need no words.
/operator==\(.*= default;/ || /\(([A-Za-z]+)&&\) noexcept;/ { print ""; next }

# "double a = 0.0, b = 0.0;" in pieces, each with the comment: Doxygen gives it to one of them alone.
function split_declaration(code, comment,    type, count, depth, at, c, part, parts, result, i) {
  if (!match(code, /^ +[a-zA-Z_:0-9]+ [a-z_0-9]+[ ={;,]/) || code ~ /^ +(return|using|explicit)/) return ""
  match(code, /^ +[a-zA-Z_:0-9]+ /)
  type = substr(code, 1, RLENGTH)
  count = depth = 0
  part = ""
  for (at = RLENGTH + 1; at <= length(code); ++at) {
    c = substr(code, at, 1)
    if (c ~ /[({]/) ++depth
    if (c ~ /[)}]/) --depth
    if (depth == 0 && c ~ /[,;]/) {
      parts[++count] = part
      part = ""
    } else {
      part = part c
    }
  }
  if (count < 2) return ""
  result = ""
  for (i = 1; i <= count; ++i) result = result type parts[i] ";" (comment == "" ? "" : " /**< " comment " */")
  return result
}

/^ *\/\/\// { pending = pending substr($0, index($0, "///") + 3); follows = 0; held = held $0 "\n"; next }

{
  code = $0
  comment = ""
  if (code ~ /[;,{}] +\/\/ / && code !~ /^ *(}|return|\/\/|for|if|while|#)/) {
    match(code, /[;,{}] +\/\/ /)
    comment = substr(code, RSTART + RLENGTH)
    code = substr(code, 1, RSTART)
  }
  pieces = split_declaration(code, comment == "" ? pending : comment)
  if (pieces != "" && comment == "") gsub(/[^\n]/, "", held)  # each piece has it
  printf "%s", held
  held = pending = ""
}
pieces != "" { print pieces; follows = 0; next }
comment != "" { print code "  ///< " comment; follows = 1; next }
follows && /^ +\/\/ / { sub(/\/\/ /, "///< "); print; next }
{ follows = 0; print }
