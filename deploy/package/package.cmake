# What is installed, and the packages made of it: `cmake --build build --target package` makes candela_*.deb and a
# relocatable candela-*.tar.gz in build/. Programs have no RPATH; they find modules in ../lib/candela.
include(GNUInstallDirs)
set(package_folder ${CMAKE_CURRENT_LIST_DIR})

install(TARGETS candela candela-master candela-worker RUNTIME DESTINATION bin)
install(TARGETS candela_images_module candela_notices_module LIBRARY DESTINATION lib/candela)
if(CANDELA_OPENVDB)
  install(TARGETS candela_vdb_module LIBRARY DESTINATION lib/candela)
endif()
install(FILES deploy/systemd/candela-master.service deploy/systemd/candela-worker@.service DESTINATION lib/systemd/system)
install(FILES deploy/systemd/candela.conf DESTINATION lib/sysusers.d)
install(FILES deploy/systemd/tls.conf DESTINATION share/candela/systemd)
install(DIRECTORY deploy/scenes DESTINATION share/candela)
install(FILES LICENSE DESTINATION share/doc/candela RENAME copyright)
# Man pages and completion, from the command's own help.
install(CODE "
  set(candela \"$<TARGET_FILE:candela>\")
  set(share \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/share\")
  file(MAKE_DIRECTORY \"\${share}/man/man1\" \"\${share}/bash-completion/completions\" \"\${share}/zsh/vendor-completions\")
  execute_process(COMMAND \"\${candela}\" help-man \"\${share}/man/man1\" COMMAND_ERROR_IS_FATAL ANY)
  foreach(each \"$<TARGET_FILE:candela-master>|master of the render farm\" \"$<TARGET_FILE:candela-worker>|worker of the render farm\")
    string(REPLACE \"|\" \";\" each \"\${each}\")
    list(GET each 0 program)
    list(GET each 1 text)
    get_filename_component(name \"\${program}\" NAME)
    execute_process(COMMAND \"${CMAKE_COMMAND}\" -D PROGRAM=\${program} -D \"TEXT=\${text}\" -D OUT=\${share}/man/man1/\${name}.1
                            -P \"${package_folder}/man_page.cmake\" COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
  file(GLOB pages \"\${share}/man/man1/candela*.1\")
  execute_process(COMMAND gzip -9nf \${pages} COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND \"\${candela}\" completion bash COMMAND_ERROR_IS_FATAL ANY
                  OUTPUT_FILE \"\${share}/bash-completion/completions/candela\")
  execute_process(COMMAND \"\${candela}\" completion zsh COMMAND_ERROR_IS_FATAL ANY
                  OUTPUT_FILE \"\${share}/zsh/vendor-completions/_candela\")")

set(CPACK_GENERATOR "DEB;TGZ")
set(CPACK_PACKAGE_NAME candela)
set(CPACK_PACKAGE_VENDOR "The Candela authors")
set(CPACK_PACKAGE_CONTACT "The Candela authors <candela@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "distributed render farm for physically based light transport")
set(CPACK_PACKAGE_DESCRIPTION "A master, workers and a command to render Mitsuba and pbrt scenes.
The same scene and seed give the same image to the last bit, on one machine or on many.")
set(CPACK_VERBATIM_VARIABLES TRUE)
set(CPACK_STRIP_FILES TRUE)
set(CPACK_THREADS 0)
set(CPACK_DEBIAN_COMPRESSION_TYPE zstd)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS TRUE)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "systemd | systemd-standalone-sysusers")  # systemd-sysusers, in postinst
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION TRUE)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${package_folder}/postinst ${package_folder}/prerm ${package_folder}/postrm
    ${package_folder}/conffiles)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PROJECT_CONFIG_FILE ${package_folder}/version.cmake)
set(CPACK_PRE_BUILD_SCRIPTS ${package_folder}/conffile.cmake)
include(CPack)
