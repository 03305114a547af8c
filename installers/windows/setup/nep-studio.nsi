; Installer of NEP Studio for the current user, without administrator rights, 64 bit. `installers.windows.nsis`
; defines the constants in ${...} and generates entries.nsh and association.nsh.
;
;   /S        silent; exit code 0 for success, 2 for a failure (no disk space, ...), 3 if NEP Studio is open
;   /PATH     add the command `nep` to the user's PATH
;   /D=FOLDER install to another folder; must be last and without quotes
;
; In silent mode, messages are written to the standard output and to %TEMP%\NEP-Studio-setup.txt.

Name "NEP Studio"
OutFile "${OUTPUT}"
InstallDir "$LOCALAPPDATA\Programs\NEP Studio"
InstallDirRegKey HKCU "Software\NEP Studio" "Folder"
RequestExecutionLevel user
ManifestDPIAware true
ManifestSupportedOS Win10
SetCompressor /SOLID lzma
SetCompressorDictSize 64
SetOverwrite on
AllowSkipFiles off
BrandingText "NEP Studio ${VERSION}"

VIProductVersion "${VERSION_NUMBERS}"
VIAddVersionKey /LANG=0 "ProductName" "NEP Studio"
VIAddVersionKey /LANG=0 "ProductVersion" "${VERSION}"
VIAddVersionKey /LANG=0 "FileVersion" "${VERSION}"
VIAddVersionKey /LANG=0 "FileDescription" "NEP Studio Setup"
VIAddVersionKey /LANG=0 "CompanyName" "${PUBLISHER}"
VIAddVersionKey /LANG=0 "LegalCopyright" "${COPYRIGHT}"

!include "MUI2.nsh"
!include "LogicLib.nsh"
!include "FileFunc.nsh"
!include "WinMessages.nsh"

!define UNINSTALL_KEY "Software\Microsoft\Windows\CurrentVersion\Uninstall\NEP Studio"
!define EXIT_FAILED 2
!define EXIT_OPEN 3
!define ON_PATH 1

Var NewFolder
Var OldFolder
Var KeepData
Var IsMoved

!include "entries.nsh"
!include "association.nsh"
!include "path.nsh"

!define MUI_ICON "${ICON}"
!define MUI_UNICON "${ICON}"
!define MUI_ABORTWARNING
!define MUI_COMPONENTSPAGE_SMALLDESC
!define MUI_WELCOMEFINISHPAGE_BITMAP "${PICTURE}"
!define MUI_UNWELCOMEFINISHPAGE_BITMAP "${PICTURE}"
!define MUI_FINISHPAGE_RUN "$INSTDIR\nep-studio.exe"
!insertmacro MUI_PAGE_LICENSE "${LICENSE}"
!insertmacro MUI_PAGE_COMPONENTS
!insertmacro MUI_PAGE_DIRECTORY
!insertmacro MUI_PAGE_INSTFILES
!insertmacro MUI_PAGE_FINISH
!insertmacro MUI_UNPAGE_CONFIRM
!insertmacro MUI_UNPAGE_INSTFILES
!insertmacro MUI_LANGUAGE "English"
!insertmacro MUI_LANGUAGE "Spanish"
!insertmacro MUI_LANGUAGE "French"
!insertmacro MUI_LANGUAGE "Japanese"
!include "words.nsh"
!insertmacro MUI_RESERVEFILE_LANGDLL

; ---- messages and checks ------------------------------------------------------------------------------

!macro ShowMessage text
  ${If} ${Silent}
    System::Call 'kernel32::GetStdHandle(i -11) p .r8'
    ${If} $8 P<> 0
    ${AndIf} $8 P<> -1
      FileWrite $8 "${text}$\r$\n"
    ${EndIf}
    FileOpen $8 "$TEMP\NEP-Studio-setup.txt" a
    FileSeek $8 0 END
    FileWriteUTF16LE /BOM $8 "${text}$\r$\n"
    FileClose $8
  ${Else}
    MessageBox MB_OK|MB_ICONEXCLAMATION "${text}"
  ${EndIf}
!macroend

!macro Functions UN

; Sets $0 to 1 if a program of Studio is running from $INSTDIR: Windows denies writing to running programs.
Function ${UN}CheckOpen
  StrCpy $0 0
  !insertmacro ForEachProgram CheckProgram
FunctionEnd

; Waits until Studio is closed; quits in silent mode or if the user cancels.
Function ${UN}WaitUntilClosed
  Call ${UN}CheckOpen
  ${While} $0 = 1
    ${If} ${Silent}
      !insertmacro ShowMessage "$(StudioIsOpen)"
      SetErrorLevel ${EXIT_OPEN}
      Quit
    ${EndIf}
    MessageBox MB_RETRYCANCEL|MB_ICONEXCLAMATION "$(StudioIsOpen)" IDRETRY +3
    SetErrorLevel ${EXIT_OPEN}
    Quit
    Call ${UN}CheckOpen
  ${EndWhile}
FunctionEnd

!insertmacro PathFunctions "${UN}"

!macroend

!macro CheckProgram name
  ${If} ${FileExists} "$INSTDIR\${name}"
    ClearErrors
    FileOpen $1 "$INSTDIR\${name}" a
    ${If} ${Errors}
      StrCpy $0 1
    ${Else}
      FileClose $1
    ${EndIf}
  ${EndIf}
!macroend

!insertmacro Functions ""
!insertmacro Functions "un."

; ---- installation -------------------------------------------------------------------------------------

!macro MoveOut name
  ${If} $IsMoved = 1
  ${AndIf} ${FileExists} "$INSTDIR\${name}"
    !insertmacro Move "$INSTDIR\${name}" "$OldFolder\${name}"
  ${EndIf}
!macroend

!macro MoveIn name
  ${If} $IsMoved = 1
    !insertmacro Move "$NewFolder\${name}" "$INSTDIR\${name}"
  ${EndIf}
!macroend

; Moves an old file back to $INSTDIR; a new file in its place is moved out first.
!macro MoveBack name
  ${If} ${FileExists} "$OldFolder\${name}"
    ${If} ${FileExists} "$INSTDIR\${name}"
      !insertmacro Move "$INSTDIR\${name}" "$NewFolder\${name}"
    ${EndIf}
    !insertmacro Move "$OldFolder\${name}" "$INSTDIR\${name}"
  ${EndIf}
!macroend

!macro Move from to
  StrCpy $R0 "${from}"
  StrCpy $R1 "${to}"
  Call Move
!macroend

; Renames $R0 to $R1; sets $IsMoved to 0 on failure. Retries for ten seconds, because virus scanners briefly lock new
; files. (The error flag of NSIS can't replace $IsMoved, because it is cleared when it is read.)
Function Move
  StrCpy $R2 0
  ${Do}
    ClearErrors
    Rename $R0 $R1
    ${IfNot} ${Errors}
      Return
    ${EndIf}
    Sleep 500
    IntOp $R2 $R2 + 1
  ${LoopUntil} $R2 = 20
  StrCpy $IsMoved 0
FunctionEnd

; A new version is unpacked next to the old one and replaces it by renaming, which needs no disk space. If the disk is
; full or a file can't be moved, the old version stays intact.
Section "!NEP Studio" SectionStudio
  SectionIn RO
  StrCpy $NewFolder "$INSTDIR\new~"
  StrCpy $OldFolder "$INSTDIR\old~"
  Call WaitUntilClosed
  Call RepairInterruptedUpdate
  Call CheckDiskSpace
  SetOutPath $NewFolder
  !insertmacro UnpackEntries
  WriteUninstaller "$NewFolder\uninstall.exe"
  ; The current folder can't be renamed.
  SetOutPath $TEMP

  CreateDirectory $OldFolder
  StrCpy $IsMoved 1
  !insertmacro ForEachEntry MoveOut
  !insertmacro ForEachEntry MoveIn
  ${If} $IsMoved = 0
    !insertmacro ForEachEntry MoveBack
    RMDir $OldFolder
    !insertmacro ShowMessage "$(CannotReplace)"
    SetErrorLevel ${EXIT_FAILED}
    Abort
  ${EndIf}
  RMDir /r $NewFolder
  RMDir /r $OldFolder

  WriteRegStr HKCU "Software\NEP Studio" "Folder" "$INSTDIR"
  !insertmacro Associate
  CreateShortcut "$SMPROGRAMS\NEP Studio.lnk" "$INSTDIR\nep-studio.exe"
  Call WriteUninstallEntry
  System::Call 'shell32::SHChangeNotify(i 0x08000000, i 0, p 0, p 0)'
SectionEnd

Section /o "$(PathTitle)" SectionPath
  ; Handled by the hidden section below, which also removes the entry.
SectionEnd

Section "-Path"
  ReadRegDWORD $0 HKCU "Software\NEP Studio" "OnPath"
  ${If} ${SectionIsSelected} ${SectionPath}
    Call AddToPath
  ${ElseIf} $0 = ${ON_PATH}
    Call RemoveFromPath
  ${EndIf}
SectionEnd

!insertmacro MUI_FUNCTION_DESCRIPTION_BEGIN
  !insertmacro MUI_DESCRIPTION_TEXT ${SectionStudio} "$(StudioDescription)"
  !insertmacro MUI_DESCRIPTION_TEXT ${SectionPath} "$(PathDescription)"
!insertmacro MUI_FUNCTION_DESCRIPTION_END

; An interrupted update (power failure, terminated installer) leaves the old version in old~; restore it first.
Function RepairInterruptedUpdate
  RMDir /r $NewFolder
  CreateDirectory $NewFolder
  StrCpy $IsMoved 1
  !insertmacro ForEachEntry MoveBack
  RMDir /r $NewFolder
  ${If} $IsMoved = 0
    !insertmacro ShowMessage "$(CannotReplace)"
    SetErrorLevel ${EXIT_FAILED}
    Abort
  ${EndIf}
  RMDir /r $OldFolder
FunctionEnd

Function CheckDiskSpace
  ClearErrors
  CreateDirectory "$INSTDIR\new~"
  ${If} ${Errors}
    !insertmacro ShowMessage "$(NoFolder)"
    SetErrorLevel ${EXIT_FAILED}
    Abort
  ${EndIf}
  System::Call 'kernel32::GetDiskFreeSpaceExW(w "$INSTDIR", *l .r1, p 0, p 0) i .r0'
  ${If} $0 <> 0
    System::Int64Op $1 / 1048576
    Pop $1
    ${If} $1 L< ${NEEDED_MB}
      StrCpy $2 ${NEEDED_MB}
      !insertmacro ShowMessage "$(NotEnoughSpace)"
      SetErrorLevel ${EXIT_FAILED}
      Abort
    ${EndIf}
  ${EndIf}
FunctionEnd

Function WriteUninstallEntry
  WriteRegStr HKCU "${UNINSTALL_KEY}" "DisplayName" "NEP Studio"
  WriteRegStr HKCU "${UNINSTALL_KEY}" "DisplayVersion" "${VERSION}"
  WriteRegStr HKCU "${UNINSTALL_KEY}" "DisplayIcon" "$INSTDIR\nep-studio.exe,0"
  WriteRegStr HKCU "${UNINSTALL_KEY}" "Publisher" "${PUBLISHER}"
  WriteRegStr HKCU "${UNINSTALL_KEY}" "InstallLocation" "$INSTDIR"
  WriteRegStr HKCU "${UNINSTALL_KEY}" "UninstallString" '"$INSTDIR\uninstall.exe"'
  WriteRegStr HKCU "${UNINSTALL_KEY}" "QuietUninstallString" '"$INSTDIR\uninstall.exe" /S'
  WriteRegDWORD HKCU "${UNINSTALL_KEY}" "EstimatedSize" ${SIZE_KB}
  WriteRegDWORD HKCU "${UNINSTALL_KEY}" "NoModify" 1
  WriteRegDWORD HKCU "${UNINSTALL_KEY}" "NoRepair" 1
FunctionEnd

Function .onInit
  System::Call 'kernel32::CreateMutexW(p 0, i 1, w "NEP Studio Setup") p .r1 ?e'
  Pop $0
  ${If} $0 = 183 ; ERROR_ALREADY_EXISTS
    !insertmacro ShowMessage "$(SetupIsRunning)"
    SetErrorLevel ${EXIT_FAILED}
    Quit
  ${EndIf}
  ${GetParameters} $1
  ClearErrors
  ${GetOptions} $1 "/PATH" $2
  ${IfNot} ${Errors}
    !insertmacro SelectSection ${SectionPath}
  ${EndIf}
  ; An update keeps the previous choice.
  ReadRegDWORD $0 HKCU "Software\NEP Studio" "OnPath"
  ${If} $0 = ${ON_PATH}
    !insertmacro SelectSection ${SectionPath}
  ${EndIf}
  Call WaitUntilClosed
FunctionEnd

Function .onInstFailed
  SetOutPath $TEMP
  RMDir /r "$INSTDIR\new~"
  RMDir "$INSTDIR"
  !insertmacro ShowMessage "$(NotInstalled)"
FunctionEnd

; ---- uninstallation -----------------------------------------------------------------------------------

Function un.onInit
  Call un.WaitUntilClosed
  StrCpy $KeepData 1
  MessageBox MB_YESNO|MB_ICONQUESTION "$(KeepUserData)" /SD IDYES IDYES +2
  StrCpy $KeepData 0
FunctionEnd

!macro Remove name
  ${If} ${FileExists} "$INSTDIR\${name}\*.*"
    RMDir /r "$INSTDIR\${name}"
  ${Else}
    Delete "$INSTDIR\${name}"
  ${EndIf}
!macroend

Section "Uninstall"
  Call un.WaitUntilClosed
  SetOutPath $TEMP
  StrCpy $OldFolder "$INSTDIR\old~"
  ReadRegDWORD $0 HKCU "Software\NEP Studio" "OnPath"
  ${If} $0 = ${ON_PATH}
    Call un.RemoveFromPath
  ${EndIf}
  Delete "$SMPROGRAMS\NEP Studio.lnk"
  !insertmacro Dissociate
  ; Only files of the installer: the folder may contain others.
  !insertmacro ForEachEntry Remove
  RMDir /r "$INSTDIR\new~"
  RMDir /r "$OldFolder"
  RMDir "$INSTDIR"
  RMDir "$LOCALAPPDATA\Programs" ; only if empty
  DeleteRegKey HKCU "${UNINSTALL_KEY}"
  DeleteRegKey HKCU "Software\NEP Studio"
  ${If} $KeepData = 0
    RMDir /r "$LOCALAPPDATA\nep-studio"
  ${EndIf}
  System::Call 'shell32::SHChangeNotify(i 0x08000000, i 0, p 0, p 0)'
SectionEnd
