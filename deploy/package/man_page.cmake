# Writes a man page of a program from its --help, as it stands:
#   cmake -D PROGRAM=... -D TEXT=what-it-is -D OUT=FILE.1 -P man_page.cmake
get_filename_component(name ${PROGRAM} NAME)
string(TOUPPER ${name} title)
execute_process(COMMAND ${PROGRAM} --help OUTPUT_VARIABLE help COMMAND_ERROR_IS_FATAL ANY)
string(REPLACE "\\" "\\e" help "${help}")
string(REPLACE "-" "\\-" help "${help}")
string(REGEX REPLACE "(^|\n)([.'])" "\\1\\\\&\\2" help "${help}")
file(WRITE ${OUT} ".TH ${title} 1 \"\" \"Candela\" \"Candela\"\n.SH NAME\n${name} \\- ${TEXT}\n.SH USAGE\n.nf\n${help}.fi\n.SH SEE ALSO\ncandela(1)\n")
