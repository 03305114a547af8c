; Adds the folder of `nep` to the user's PATH and removes it. The value may be longer than a variable of NSIS (1024
; characters) and must keep its type (REG_EXPAND_SZ), so it is edited in allocated memory.

!define HKEY_CURRENT_USER_NUMBER -2147483647
!define REG_EXPAND_SZ_NUMBER 2
!define KEY_READ_AND_WRITE 0x2001F

!macro PathFunctions UN

; Sets $3 to the open key (0 if it can't be opened), $4 to the memory with the value between two ";", and $5 to its type.
Function ${UN}ReadPath
  StrCpy $4 0
  System::Call 'advapi32::RegOpenKeyExW(p ${HKEY_CURRENT_USER_NUMBER}, w "Environment", i 0, \
    i ${KEY_READ_AND_WRITE}, *p .r3) i .r0'
  ${If} $0 <> 0
    StrCpy $3 0
    Return
  ${EndIf}
  StrCpy $2 0
  System::Call 'advapi32::RegQueryValueExW(p r3, w "Path", p 0, *i .r5, p 0, *i .r2) i .r0'
  ${If} $0 <> 0
    StrCpy $2 0
    StrCpy $5 ${REG_EXPAND_SZ_NUMBER}
  ${EndIf}
  ; Zeroed memory for the value, ";FOLDER;" and the terminators.
  IntOp $1 $2 + 4096
  System::Call 'kernel32::GlobalAlloc(i 0x40, p r1) p .r4'
  IntPtrOp $6 $4 + 2
  System::Call 'kernel32::lstrcpyW(p r4, w ";")'
  ${If} $2 <> 0
    System::Call 'advapi32::RegQueryValueExW(p r3, w "Path", p 0, p 0, p r6, *i r2r2)'
  ${EndIf}
  System::Call 'kernel32::lstrcatW(p r4, w ";")'
FunctionEnd

; Writes the value from memory, without the surrounding ";", and closes $3.
Function ${UN}WritePath
  System::Call 'kernel32::lstrlenW(p r4) i .r1'
  IntPtrOp $6 $4 + 2
  ${If} $1 <= 2 ; the value is empty
    System::Call 'advapi32::RegDeleteValueW(p r3, w "Path")'
  ${Else}
    IntOp $2 $1 - 1
    IntOp $2 $2 * 2
    IntPtrOp $7 $4 + $2
    System::Call '*$7(&i2 0)'
    System::Call 'advapi32::RegSetValueExW(p r3, w "Path", i 0, i r5, p r6, i r2)'
  ${EndIf}
  Call ${UN}ClosePath
  ; Newly started programs use the new value.
  SendMessage ${HWND_BROADCAST} ${WM_SETTINGCHANGE} 0 "STR:Environment" /TIMEOUT=5000
FunctionEnd

Function ${UN}ClosePath
  System::Call 'kernel32::GlobalFree(p r4)'
  System::Call 'advapi32::RegCloseKey(p r3)'
FunctionEnd

Function ${UN}RemoveFromPath
  Call ${UN}ReadPath
  ${If} $3 P= 0
    Return
  ${EndIf}
  System::Call 'shlwapi::StrStrIW(p r4, w ";$INSTDIR;") p .r7'
  ${If} $7 P= 0
    Call ${UN}ClosePath
  ${Else}
    StrLen $1 ";$INSTDIR"
    IntOp $1 $1 * 2
    IntPtrOp $6 $7 + $1
    System::Call 'kernel32::lstrlenW(p r6) i .r2'
    IntOp $2 $2 + 1
    IntOp $2 $2 * 2
    System::Call 'ntdll::RtlMoveMemory(p r7, p r6, p r2)'
    Call ${UN}WritePath
  ${EndIf}
  DeleteRegValue HKCU "Software\NEP Studio" "OnPath"
FunctionEnd

!if "${UN}" == ""
Function AddToPath
  Call ReadPath
  ${If} $3 P= 0
    Return
  ${EndIf}
  System::Call 'shlwapi::StrStrIW(p r4, w ";$INSTDIR;") p .r7'
  ${If} $7 P= 0
    System::Call 'kernel32::lstrlenW(p r4) i .r1'
    ${If} $1 = 2 ; the value was empty: ";;"
      System::Call 'kernel32::lstrcpyW(p r4, w ";")'
    ${EndIf}
    System::Call 'kernel32::lstrcatW(p r4, w "$INSTDIR;")'
    Call WritePath
  ${Else}
    Call ClosePath
  ${EndIf}
  WriteRegDWORD HKCU "Software\NEP Studio" "OnPath" ${ON_PATH}
FunctionEnd
!endif

!macroend
