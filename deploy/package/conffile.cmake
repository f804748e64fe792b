# Read by cpack when the files of a package lie together. Only the Debian package has a file outside its prefix.
if(CPACK_GENERATOR STREQUAL "DEB")
  file(COPY ${CMAKE_CURRENT_LIST_DIR}/config.toml DESTINATION ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/etc/candela)
endif()
